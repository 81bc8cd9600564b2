//! Known weights on the finger: the moment at which one lies still, and the force per count that they give.

/// Looks in a second at P_DC under a weight.
pub(crate) const LOOKS_HZ: u32 = 100;
/// Looks for which it has to lie still: its mean is of 1.5 s.
const STILL: u32 = 3 * LOOKS_HZ / 2;
/// Counts that P_DC may wander meanwhile, and the share of it.
const WANDERS: (f32, f32) = (2.0, 0.04);
/// Share of its expected counts from which a weight is there: a fingertip's constants are off by half at most.
const THERE: f32 = 0.4;
/// Remainder at which a weight counts as taken away, mN: half of the least weight, and far below the rise that a rig's
/// guard takes for a press on a finger that waits.
const GONE_MN: f32 = 100.0;
/// Largest deviation of a weight from the line, mN: 3 g, since a kitchen scale shows whole ones, and the share of it
/// (chosen).
const OFF: (f32, f32) = (30.0, 0.08);

#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Still {
    mean: f32,
    looks: u32,
}

impl Still {
    /// Takes a look, counts. The mean of the last ones, once it has been still for [`STILL`] of them.
    pub(super) fn take(&mut self, counts: f32) -> Option<f32> {
        let (most, share) = WANDERS;
        let off = libm::fabsf(counts - self.mean);
        // not-a-number is not still
        let still = off <= most.max(share * libm::fabsf(self.mean));
        if self.looks == 0 || !still {
            (self.mean, self.looks) = (counts, 0);
        }
        self.looks = (self.looks + 1).min(STILL);
        self.mean += (counts - self.mean) / self.looks as f32;
        (self.looks == STILL).then_some(self.mean)
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Weighing {
    /// Counts by which a weight differs from the air at least.
    least: f32,
    /// Counts by which the air differs from itself at most, once a weight has been taken away.
    gone: f32,
    air: Option<f32>,
    still: Still,
}

impl Weighing {
    /// A weight of so many mN is to be put on, or is still there from before: first the finger is in the air.
    pub(crate) fn new(mn: u16, mn_per_count: f32) -> Self {
        Self {
            least: THERE * f32::from(mn) / mn_per_count,
            gone: GONE_MN / mn_per_count,
            air: None,
            still: Still::default(),
        }
    }

    /// The same for a finger that is in the air: P_DC there is 0 counts.
    pub(crate) fn in_air(mn: u16, mn_per_count: f32) -> Self {
        Self {
            air: Some(0.0),
            ..Self::new(mn, mn_per_count)
        }
    }

    pub(crate) fn wants_weight(&self) -> bool {
        self.air.is_some()
    }

    pub(crate) fn is_air(&self, counts: f32) -> bool {
        libm::fabsf(counts - self.air.unwrap_or_default()) < self.gone
    }

    /// Takes P_DC, counts about that in the air as it was known before, [`LOOKS_HZ`] times a second. The weight's mean
    /// above the air, once it has lain still; below 0 where P_DC falls under it, as that of a load cell that is wired
    /// the wrong way round.
    pub(crate) fn take(&mut self, counts: f32) -> Option<f32> {
        let mean = self.still.take(counts)?;
        let above = mean - self.air.unwrap_or_default();
        let there = libm::fabsf(above) >= self.least;
        if self.wants_weight() {
            return there.then_some(above);
        }
        if !there {
            (self.air, self.still) = (Some(mean), Still::default());
        }
        None
    }
}

/// The force scale that weights give.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ForceScale {
    /// Contact force of a count of P_DC, mN.
    pub mn_per_count: f32,
    /// Largest deviation of a weight from the line, mN.
    pub off_mn: f32,
}

impl ForceScale {
    /// The line through 0 that is nearest to these counts above the air and weights in mN; `None` if one of them is
    /// farther off it than a scale and a hand explain, or if P_DC falls.
    pub fn of(points: &[(f32, f32)]) -> Option<Self> {
        let (mut xy, mut xx) = (0.0, 0.0);
        for (x, y) in points {
            xy += x * y;
            xx += x * x;
        }
        let mn_per_count = xy / xx;
        let (most, share) = OFF;
        let mut off_mn = 0.0f32;
        for (x, y) in points {
            let off = libm::fabsf(mn_per_count * x - y);
            // written as what must hold, for not-a-number
            if !(off <= most.max(share * y) && *x > 0.0) {
                return None;
            }
            off_mn = off_mn.max(off);
        }
        (!points.is_empty()).then_some(Self {
            mn_per_count,
            off_mn,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes P_DC at each level for so many looks; returns the weight.
    fn weigh(mut weighing: Weighing, levels: &[(f32, u32)]) -> Option<f32> {
        let mut looks = 0u32;
        let mut each = levels
            .iter()
            .flat_map(|&(counts, looks)| core::iter::repeat_n(counts, looks as usize));
        each.find_map(|counts| {
            looks += 1;
            weighing.take(counts + if looks.is_multiple_of(2) { 0.3 } else { -0.3 })
        })
    }

    #[test]
    fn a_weight_is_taken_once_it_lies_still_after_the_air() {
        let new = Weighing::new(981, 10.0);
        let is =
            |counts: Option<f32>, wanted: f32| counts.is_some_and(|c| (c - wanted).abs() < 0.3);
        // the weight before is still there, then the air has drifted by 3 counts
        let levels = [(58.0, 500), (-3.0, 160), (95.0, 160)];
        assert!(is(weigh(new, &levels), 98.0));
        // it is laid on slowly
        let slowly: [(f32, u32); 12] = core::array::from_fn(|n| (8.0 * n as f32, 20));
        let levels = [&[(0.0, 160)], &slowly[..], &[(98.0, 160)]].concat();
        assert!(is(weigh(new, &levels), 98.0));
        // too light for that weight, or not for long enough
        assert_eq!(
            weigh(new, &[(0.0, 160), (35.0, 1000), (98.0, 140), (0.0, 1000)]),
            None
        );
        // known to be in the air
        assert!(is(weigh(Weighing::in_air(981, 10.0), &[(98.0, 160)]), 98.0));
        assert_eq!(weigh(new, &[(0.0, 160), (f32::NAN, 1000)]), None);
    }

    #[test]
    fn a_cell_that_is_wired_the_wrong_way_round_falls() {
        let fell = weigh(Weighing::new(294, 9.35), &[(1.0, 160), (-30.4, 160)]);
        assert!(
            fell.is_some_and(|counts| (counts + 31.4).abs() < 0.3),
            "{fell:?}"
        );
    }

    #[test]
    fn a_line_through_weights_is_found_and_one_weight_that_is_another_refused() {
        let of = |counts: [f32; 5]| {
            let mn = [294.0, 588.0, 883.0, 1177.0, 1471.0];
            ForceScale::of(&core::array::from_fn::<_, 5, _>(|n| (counts[n], mn[n])))
        };
        let scale = of([29.4, 58.8, 88.3, 117.7, 147.1]).unwrap();
        assert!((scale.mn_per_count - 10.0).abs() < 1e-4, "{scale:?}");
        assert!(scale.off_mn < 0.1, "{scale:?}");
        // the third is 20 mN too light
        let scale = of([29.4, 58.8, 90.3, 117.7, 147.1]).unwrap();
        assert!((10.0..20.0).contains(&scale.off_mn), "{scale:?}");
        // 3 g of 30 are a scale's error, and no wrong weight
        assert!(of([31.9, 58.8, 88.3, 117.7, 147.1]).is_some());
        // the third was laid on twice; the fourth is a third heavier than its label
        assert_eq!(of([29.4, 58.8, 88.3, 88.3, 147.1]), None);
        assert_eq!(of([29.4, 58.8, 88.3, 157.0, 147.1]), None);
        assert_eq!(of([-29.4, -58.8, -88.3, -117.7, -147.1]), None);
        assert_eq!(of([0.0; 5]), None);
        assert_eq!(of([f32::NAN, 58.8, 88.3, 117.7, 147.1]), None);
        assert_eq!(ForceScale::of(&[]), None);
    }
}
