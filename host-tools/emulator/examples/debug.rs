use tactus_emulator::*;
use tactus_core::wire::*;
fn main() {
    let e = Emulator::start(std::path::Path::new(&std::env::args().nth(1).unwrap()), Setup::default(), Options::default()).unwrap();
    let mut t = talk::Talk::new(e);
    for _ in 0..310 { for r in t.step().unwrap() { println!("{r:?}"); } }
    let mut n = 0;
    let r = t.ask(Ask::Home, 0.01, |b, r| { if let Some(r)=r { if !matches!(r.tell, Tell::Live(_)) {println!("{:.3} {r:?}", b.now_ns() as f64*1e-9);} } n+=1; if n%100==0 {
        let mut rig = b.rig();
        let tr = rig.world().truth();
        println!("{:.3} tip {} stage {} v {} missing {} bad {} top {} steps {}", tr.at_ns as f64*1e-9, tr.tip_mm, tr.stage_mm, tr.speed_mm_s, tr.lever_missing_steps, tr.lever_bad_pulses, rig.world().lever_top(), rig.trace().filter(|x| matches!(x.1, Output::LeverStep(true))).count());
    }});
    println!("{r:?}");
    let mut n=0; for x in t.board().rig().trace() { n+=1; if n<40 {println!("{x:?}");} }
}
