//! The reader of fabrics against the real recordings of `data/fabricslide`.
use tactus_study::fabricslide::FabricSet;
use tactus_tests::data;

#[test]
fn the_fabrics_share_15_movements() {
    let Some(folder) = data("fabricslide") else {
        return;
    };
    let set = FabricSet::open(&folder).unwrap();
    assert_eq!(
        set.fabrics.join(" "),
        "BeigeCotton BrownCotton Canvas Denim DenimFlex Linen WovenFabric"
    );
    let movements: Vec<(u16, u32)> = set.movements.iter().map(|m| (*m).into()).collect();
    let expected = [120, 150, 180].into_iter().flat_map(|setpoint| {
        [10, 20, 50, 100, 120].map(|speed_mm_s| (setpoint, speed_mm_s * 1000))
    });
    assert_eq!(movements, expected.collect::<Vec<_>>());
    let mut slides = set.slides.iter();
    for fabric in 0..7 {
        for movement in 0..15 {
            for repetition in [0, 0, 1, 1] {
                let slide = slides.next().unwrap();
                assert_eq!(
                    (slide.fabric, slide.movement, slide.repetition),
                    (fabric, movement, repetition)
                );
            }
        }
    }
    assert!(slides.next().is_none());
}

/// Made by another program (numpy) from the same files: a slide that is shorter than a frame, a whole one, then the
/// mean of all 420 slides; eight bands, three properties.
#[test]
fn slides_measure_as_another_program_does() {
    let Some(folder) = data("fabricslide") else {
        return;
    };
    let set = FabricSet::open(&folder).unwrap();
    const SHORT: &str = "2.4640515 3.2214791 3.2466857 2.1133103 3.7935914 2.3069171 2.6314863 1.665087 4.3923192 \
                         3.4758312 -1.0009744";
    const WHOLE: &str = "5.1221195 4.154514 2.8263621 2.0855222 3.9675076 2.099784 1.5238672 1.0457624 2.387218 \
                         3.1556271 -0.5103433";
    const MEAN: &str = "4.020075088632337 4.0051208876644715 3.6864437011933218 3.1375924805730637 3.056505717771513 \
                        1.9829268752502724 1.4141445646709612 0.8721682232544705 3.0838835892812844 \
                        3.084704912778131 -0.3812783689517751";
    let figures: Vec<Vec<f64>> = set
        .slides
        .iter()
        .map(|slide| {
            let all = slide.ln_bands.iter().chain(&slide.properties);
            all.map(|x| f64::from(*x)).collect()
        })
        .collect();
    let slides = figures.len() as f64;
    let mean = (0..11).map(|n| figures.iter().map(|of| of[n]).sum::<f64>() / slides);
    let slide = |[fabric, movement, repetition, half]: [usize; 4]| {
        figures[((fabric * 15 + movement) * 2 + repetition) * 2 + half].clone()
    };
    for (found, golden) in [
        (slide([3, 4, 1, 1]), SHORT),
        (slide([0, 0, 0, 0]), WHOLE),
        (mean.collect(), MEAN),
    ] {
        let golden = golden.split_whitespace().map(|x| x.parse::<f64>().unwrap());
        let near = found.iter().zip(golden).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(near, "{found:?}");
    }
}
