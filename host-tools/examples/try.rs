//! x
use tactus::sim::world::Setup;
use tactus::simulated::SimRig;
use tactus_core::movement::Movement;
use tactus_core::rig::control::Phase;
fn main() {
    let tex: u8 = std::env::args().nth(1).map_or(1, |a| a.parse().unwrap());
    let mut rig = SimRig::new(Setup {
        texture: tex,
        ..Setup::default()
    });
    let t = std::time::Instant::now();
    if std::env::args().nth(2).as_deref() == Some("nothome") {
        for _ in 0..101 {
            rig.tick();
        }
        rig.world()
            .inject(tactus::sim::faults::Fault::LeverTopStuck { closed: false });
        println!("{:?}", rig.home());
        println!("{:?}", rig.world().truth());
        rig.world().clear();
        rig.control().reset();
        println!("{:?}", rig.home());
        println!("{:?} {:?}", rig.world().truth(), rig.world().lever_top());
        rig.control().start(Movement::FOR_TRACTION, 0.0).unwrap();
        for n in 0..10000 {
            rig.tick();
            if n % 500 == 0 {
                println!(
                    "{:?} {:?} {} {:?}",
                    rig.control().phase(),
                    rig.world().truth().tip_mm,
                    rig.world().truth().lever_missing_steps,
                    rig.world().lever_top()
                );
            }
        }
        return;
    }
    println!("home {:?} at {:?}", rig.home(), rig.now());
    println!("truth {:?}", rig.world().truth());
    println!("cal {:?} at {:?}", rig.calibrate_current(), rig.now());
    for m in [
        Movement::FOR_TRACTION,
        Movement::FOR_FINENESS,
        Movement::FOR_ROUGHNESS,
    ] {
        for k in 0..2 {
            rig.world().reset_extremes();
            if let Err(e) = rig.control().start(m, 0.3 * k as f32) {
                println!("refused {e}");
            }
            let mut last = Phase::Ready;
            let mut n = 0u32;
            let (mut vmin, mut vmax, mut vs, mut vn) = (1e9f64, -1e9f64, 0.0f64, 0);
            let mut win = Vec::new();
            loop {
                rig.tick();
                n += 1;
                let p = rig.control().phase();
                if p != last {
                    let tr = rig.world().truth();
                    println!(
                        "{:8.3}s {:?} -> {:?} force {:.4} target {:.3} meter {:.4} tip {:.3} stage {:.2}",
                        rig.now().as_secs_f64(),
                        last,
                        p,
                        tr.force_n,
                        m.force_n(),
                        rig.control().force_mn() / 1e3,
                        tr.tip_mm,
                        tr.stage_mm
                    );
                    last = p;
                }
                if p == Phase::Sliding && rig.outputs().shear_mn.is_some() {
                    let v = rig.world().truth().speed_mm_s;
                    vs += v;
                    vn += 1;
                    win.push(v);
                    vmin = vmin.min(v);
                    vmax = vmax.max(v);
                }
                if n > 60000
                    || p == Phase::Ready
                    || matches!(p, Phase::Faulted(_))
                        && rig.outputs().lever_steps_s == 0
                        && rig.outputs().lever_enabled
                {
                    break;
                }
            }
            let w50: Vec<f64> = win
                .windows(50)
                .map(|w| w.iter().sum::<f64>() / 50.0)
                .collect();
            println!(
                "  {m}: speed mean {:.3} min {vmin:.3} max {vmax:.3} w50 {:.3}..{:.3} n {vn} ended {:?} current {:?} fmax {:.3}",
                vs / vn as f64,
                w50.iter().cloned().fold(1e9f64, f64::min),
                w50.iter().cloned().fold(-1e9f64, f64::max),
                rig.control().take_ended(),
                rig.control().mean_current_a(),
                rig.world().truth().force_max_n
            );
        }
    }
    println!("virtual {:?} in {:?}", rig.now(), t.elapsed());
}
