use super::bench::*;
use crate::sim::finger::Finger;

const TEN: [u8; 10] = [2, 10, 30, 43, 45, 46, 47, 84, 87, 100];
const V: [f64; 6] = [10.0, 15.85, 25.12, 39.81, 63.1, 100.0];
const F: [f64; 6] = [0.2, 0.317, 0.502, 0.796, 1.262, 2.0];

#[test]
fn fig6() {
    let mut finger = Finger::new(5);
    for t in TEN {
        let s = sample(t, 1);
        print!("T{t:3} ");
        for v in V {
            let p: Vec<_> = (0..4)
                .map(|i| slide(&mut finger, &s, 0.2, v, i).properties())
                .collect();
            print!(
                " {:4.0}/{:4.1}/{:.3}",
                mean(p.iter().map(|p| p.fineness)).exp(),
                mean(p.iter().map(|p| p.roughness)),
                mean(p.iter().map(|p| p.traction))
            );
        }
        println!();
    }
    println!("wear {}", finger.wear());
}

pub(super) fn uncertainty(s: &[Vec<f64>]) -> f64 {
    let k = s.len() as f64;
    let g: Vec<_> = s
        .iter()
        .map(|v| (mean(v.iter().copied()), deviation(v).max(1e-9).powi(2)))
        .collect();
    let sum: f64 = g
        .iter()
        .map(|a| {
            1.0 / g
                .iter()
                .map(|b| {
                    ((2.0 * (a.1 * b.1).sqrt()) / (a.1 + b.1)).sqrt()
                        * (-(a.0 - b.0).powi(2) / (4.0 * (a.1 + b.1))).exp()
                })
                .sum::<f64>()
        })
        .sum();
    1.0 - sum / k
}

#[test]
fn fig7() {
    for seed in 1..=2 {
        let surfaces: Vec<_> = TEN.iter().map(|t| sample(*t, seed)).collect();
        for f in F {
            print!("{f:.2} ");
            for v in V {
                let mut finger = Finger::new(5);
                let p: Vec<Vec<_>> = surfaces
                    .iter()
                    .map(|s| {
                        (0..6)
                            .map(|i| slide(&mut finger, s, f, v, i * 7).properties())
                            .collect()
                    })
                    .collect();
                let u = |get: &dyn Fn(&Properties) -> f64| {
                    uncertainty(
                        &p.iter()
                            .map(|p| p.iter().map(get).collect())
                            .collect::<Vec<_>>(),
                    )
                };
                let sd = mean(
                    p.iter()
                        .map(|p| deviation(&p.iter().map(|p| p.roughness).collect::<Vec<_>>())),
                );
                let sdf = mean(
                    p.iter()
                        .map(|p| deviation(&p.iter().map(|p| p.fineness).collect::<Vec<_>>())),
                );
                print!(
                    " {:.2}/{:.2}/{:.2} ({sd:.2} {sdf:.2})",
                    u(&|p| p.traction),
                    u(&|p| p.roughness),
                    u(&|p| p.fineness)
                );
            }
            println!();
        }
    }
}

#[test]
fn table3() {
    for seed in 1..=6 {
        let surfaces: Vec<_> = (1..=117).map(|t| sample(t, seed)).collect();
        for (f, v) in [(1.26, 10.0), (0.5, 25.1), (0.2, 63.1)] {
            let mut finger = Finger::new(seed);
            let p: Vec<_> = surfaces
                .iter()
                .map(|s| slide(&mut finger, s, f, v, seed).properties())
                .collect();
            let get = |g: &dyn Fn(&Properties) -> f64| p.iter().map(g).collect::<Vec<_>>();
            let (t, r, n) = (
                get(&|p| p.traction),
                get(&|p| p.roughness),
                get(&|p| p.fineness),
            );
            let mut dev: Vec<(f64, usize)> = surfaces
                .iter()
                .enumerate()
                .map(|(i, s)| {
                    (
                        (slide(&mut finger, s, f, v, seed + 9).force_n / f - 1.0) * 1.0,
                        i + 1,
                    )
                })
                .collect();
            dev.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
            if seed == 1 {
                println!("0 dev {:?} median {:.3}", &dev[..8], dev[58].0);
            }
            let mut rs = r.clone();
            rs.sort_by(f64::total_cmp);
            println!(
                "{seed} {f} {v}: TR {:.2} TF {:.2} RF {:.2}  rough {:.1} {:.1} {:.1} {:.1} {:.1}",
                correlation(&t, &r),
                correlation(&t, &n),
                correlation(&r, &n),
                rs[0],
                rs[29],
                rs[58],
                rs[88],
                rs[116]
            );
            if seed == 1 {
                let mut gs: Vec<(u8, f64, f64, f64)> = (0..117)
                    .map(|i| (i as u8 + 1, t[i], r[i], n[i].exp()))
                    .collect();
                gs.sort_by(|a, b| a.2.total_cmp(&b.2));
                if v > 60.0 {
                    for g in gs {
                        print!("{}:{:.2},{:.1},{:.0} ", g.0, g.1, g.2, g.3);
                    }
                    println!();
                }
            }
        }
    }
}

#[test]
fn speed() {
    use crate::sim::finger::Contact;
    let s = sample(100, 1);
    let mut finger = Finger::new(1);
    let t = std::time::Instant::now();
    let n = 2_000_000;
    for i in 0..n {
        finger.tick(&Contact {
            indentation_mm: 0.63,
            surface: Some(&s),
            x_mm: (i % 900_000) as f64 * 75.0 / 900_000.0,
            speed_mm_s: 1.1,
            lever_vibration: 0.0,
        });
        if i % 6 == 0 {
            finger.sample_pac(0.5);
            finger.sample_pdc(0.5);
        }
    }
    println!(
        "F {} {:.2} M ticks/s",
        finger.force_n(),
        n as f64 / t.elapsed().as_secs_f64() / 1e6
    );
    let t = std::time::Instant::now();
    for i in 0..100 {
        sample(i + 1, 2);
    }
    println!("surface {:?}", t.elapsed() / 100);
}
