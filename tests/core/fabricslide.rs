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
        set.fabrics,
        [
            "BeigeCotton",
            "BrownCotton",
            "Canvas",
            "Denim",
            "DenimFlex",
            "Linen",
            "WovenFabric"
        ]
    );
    let movements: Vec<(u16, u32)> = set.movements.iter().map(|m| (*m).into()).collect();
    let mut expected = Vec::new();
    for setpoint in [120, 150, 180] {
        for speed_mm_s in [10, 20, 50, 100, 120] {
            expected.push((setpoint, speed_mm_s * 1000));
        }
    }
    assert_eq!(movements, expected);
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

/// Made by another program (numpy) from the same files: four slides, two of which are shorter than a frame, then the mean of
/// all 420 slides.
#[test]
fn slides_measure_as_another_program_does() {
    let Some(folder) = data("fabricslide") else {
        return;
    };
    let set = FabricSet::open(&folder).unwrap();
    // fabric, movement, repetition, half; eight bands, three properties
    let golden = [
        (
            (0, 0, 0, 0),
            [
                5.1221195, 4.154514, 2.8263621, 2.0855222, 3.9675076, 2.099784, 1.5238672,
                1.0457624, 2.387218, 3.1556271, -0.5103433,
            ],
        ),
        (
            (3, 4, 1, 1),
            [
                2.4640515, 3.2214791, 3.2466857, 2.1133103, 3.7935914, 2.3069171, 2.6314863,
                1.665087, 4.3923192, 3.4758312, -1.0009744,
            ],
        ),
        (
            (6, 14, 0, 1),
            [
                2.405801, 3.0546833, 2.9894852, 2.872051, 2.5887428, 2.0886859, 1.7592463,
                1.1348154, 3.6185443, 3.5930531, -0.2395734,
            ],
        ),
        (
            (4, 7, 1, 0),
            [
                5.7206379, 4.9356805, 4.6063242, 5.3140936, 4.8555613, 3.5834151, 2.2282773,
                1.5592869, 3.7713141, 2.8892359, -0.5503684,
            ],
        ),
    ];
    let near = |found: &[f64], expected: &[f64]| {
        let all = found.iter().zip(expected);
        assert!(
            all.clone().all(|(a, b)| (a - b).abs() < 1e-5),
            "{found:?} {expected:?}"
        );
    };
    let figures = |slide: &tactus_study::fabricslide::FabricSlide| -> Vec<f64> {
        let all = slide.ln_bands.iter().chain(&slide.properties);
        all.map(|x| f64::from(*x)).collect()
    };
    for ((fabric, movement, repetition, half), expected) in golden {
        let slide = &set.slides[((fabric * 15 + movement) * 2 + repetition) * 2 + half];
        near(&figures(slide), &expected);
    }
    let mut mean = vec![0.0; 11];
    for slide in &set.slides {
        for (mean, x) in mean.iter_mut().zip(figures(slide)) {
            *mean += x / set.slides.len() as f64;
        }
    }
    near(
        &mean,
        &[
            4.020075088632337,
            4.0051208876644715,
            3.6864437011933218,
            3.1375924805730637,
            3.056505717771513,
            1.9829268752502724,
            1.4141445646709612,
            0.8721682232544705,
            3.0838835892812844,
            3.084704912778131,
            -0.3812783689517751,
        ],
    );
}
