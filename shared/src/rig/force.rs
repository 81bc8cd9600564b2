//! Contact force from P_DC: a mean over 10 ms, and its slope.

use crate::sensor::pressure::{Calibration, Counts, RATE_HZ};

pub(crate) const MEAN_SAMPLES: usize = 22;
const KEPT: usize = 2 * MEAN_SAMPLES;
/// A mean over [`MEAN_SAMPLES`] shows the force of half its length ago, (n - 1)/2 samples.
const LAG_SAMPLES: f32 = (MEAN_SAMPLES - 1) as f32 / 2.0;

/// The last 20 ms of P_DC, and the value that means no contact.
#[derive(Clone, Debug)]
pub(crate) struct ForceMeter {
    samples: [u16; KEPT],
    next: usize,
    filled: usize,
    /// Sums of the newer and of the older half.
    newer: u32,
    older: u32,
    no_contact: f32,
    /// Sum and number of samples since [`ForceMeter::begin_long`].
    long: (u32, u32),
}

impl ForceMeter {
    /// An empty meter; `no_contact` counts mean no force.
    pub(crate) fn new(no_contact: f32) -> Self {
        Self {
            samples: [0; KEPT],
            next: 0,
            filled: 0,
            newer: 0,
            older: 0,
            no_contact,
            long: (0, 0),
        }
    }

    pub(crate) fn push(&mut self, counts: Counts) {
        let counts = counts.get();
        // the core divides in 12 cycles
        let middle = if self.next < MEAN_SAMPLES {
            self.next + (KEPT - MEAN_SAMPLES)
        } else {
            self.next - MEAN_SAMPLES
        };
        let leaving = self.samples.get(self.next).copied().unwrap_or(0);
        let ageing = self.samples.get(middle).copied().unwrap_or(0);
        if self.filled >= KEPT {
            self.older -= u32::from(leaving);
        }
        if self.filled >= MEAN_SAMPLES {
            self.newer -= u32::from(ageing);
            self.older += u32::from(ageing);
        }
        self.newer += u32::from(counts);
        if let Some(slot) = self.samples.get_mut(self.next) {
            *slot = counts;
        }
        let next = self.next + 1;
        self.next = if next < KEPT { next } else { 0 };
        self.filled = (self.filled + 1).min(KEPT);
        self.long.0 = self.long.0.saturating_add(u32::from(counts));
        self.long.1 = self.long.1.saturating_add(1);
    }

    fn is_full(&self) -> bool {
        self.filled >= KEPT
    }

    /// P_DC counts above no contact, mean over the last 10 ms; 0 before there are 10 ms of samples.
    pub(crate) fn counts(&self) -> f32 {
        self.mean().map_or(0.0, |mean| mean - self.no_contact)
    }

    /// Change of that mean per second.
    pub(crate) fn counts_per_s(&self) -> f32 {
        if !self.is_full() {
            return 0.0;
        }
        // the two means are 10 ms apart; the difference of the sums is exact
        let difference = self.newer as f32 - self.older as f32;
        difference / MEAN_SAMPLES as f32 * RATE_HZ as f32 / MEAN_SAMPLES as f32
    }

    pub(crate) fn counts_now(&self) -> f32 {
        self.counts() + self.counts_per_s() * (LAG_SAMPLES / RATE_HZ as f32)
    }

    /// Contact force in mN, mean over the last 10 ms.
    pub(crate) fn force_mn(&self, calibration: &Calibration) -> f32 {
        self.counts() * calibration.force_mn_per_count
    }

    pub(crate) fn begin_long(&mut self) {
        self.long = (0, 0);
    }

    pub(crate) fn long_counts(&self) -> Option<f32> {
        self.long_mean().map(|mean| mean - self.no_contact)
    }

    /// Takes the longer mean as the value of no contact.
    pub(crate) fn zero(&mut self) {
        if let Some(counts) = self.long_counts() {
            self.no_contact += counts;
        }
    }

    /// Makes the lowest mean from now on the value of no contact: see [`ForceMeter::sink`].
    pub(crate) fn forget_zero(&mut self) {
        self.no_contact = f32::from(Counts::MAX.get());
    }

    /// Takes the mean over the last 10 ms as the value of no contact if it is lower.
    pub(crate) fn sink(&mut self) {
        if let Some(mean) = self.mean() {
            self.no_contact = self.no_contact.min(mean);
        }
    }

    /// Mean P_DC over the last 10 ms, counts; `None` before there are 10 ms of samples.
    pub(crate) fn mean(&self) -> Option<f32> {
        (self.filled >= MEAN_SAMPLES).then(|| self.newer as f32 / MEAN_SAMPLES as f32)
    }

    pub(crate) fn long_mean(&self) -> Option<f32> {
        let (sum, samples) = self.long;
        // over ten minutes of samples fit; f64 keeps the fraction
        (samples > 0).then(|| (f64::from(sum) / f64::from(samples)) as f32)
    }

    pub(crate) fn no_contact(&self) -> f32 {
        self.no_contact
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meter(samples: impl IntoIterator<Item = u16>) -> ForceMeter {
        let mut meter = ForceMeter::new(2000.0);
        for s in samples {
            meter.push(Counts::new(s).unwrap());
        }
        meter
    }

    #[test]
    fn mean_is_of_the_last_ten_milliseconds() {
        assert_eq!(meter([2100; 21]).counts(), 0.0, "not yet");
        assert_eq!(meter([2100; 22]).counts(), 100.0);
        assert_eq!(
            meter([3000; 50].into_iter().chain([2010; 22])).counts(),
            10.0
        );
        let jump = meter([2000; 100].into_iter().chain([2022; 11]));
        assert_eq!(jump.counts(), 11.0);
    }

    #[test]
    fn a_ramp_is_seen_without_lag() {
        // one count per sample, 2200 per second
        for length in [44u16, 45, 100, 333] {
            let meter = meter((0..length).map(|n| 2000 + n));
            assert_eq!(meter.counts(), f32::from(length - 1) - 10.5);
            assert!((meter.counts_per_s() - 2200.0).abs() < 1e-2);
            assert!((meter.counts_now() - f32::from(length - 1)).abs() < 1e-3);
        }
    }

    #[test]
    fn the_lowest_mean_is_the_zero_until_there_is_one() {
        let mut meter = meter([2800; 10]);
        meter.forget_zero();
        for (counts, above) in [(2800, 0.0), (2760, 0.0), (2770, 10.0), (2950, 190.0)] {
            for _ in 0..MEAN_SAMPLES {
                meter.push(Counts::new(counts).unwrap());
                meter.sink();
            }
            assert_eq!(meter.counts(), above);
        }
        assert_eq!((meter.mean(), meter.no_contact()), (Some(2950.0), 2760.0));
    }

    #[test]
    fn zero_is_the_long_mean() {
        let mut meter = meter([2500; 60]);
        meter.begin_long();
        assert_eq!(meter.long_counts(), None);
        for n in 0..2000u16 {
            meter.push(Counts::new(2600 + n % 2).unwrap());
        }
        meter.zero();
        assert_eq!(meter.no_contact(), 2600.5);
        assert_eq!(meter.counts(), 0.0);
        let calibration = Calibration::PAPER;
        for _ in 0..22 {
            meter.push(Counts::new(2644).unwrap());
        }
        assert!((meter.force_mn(&calibration) - 43.5 * 11.5).abs() < 1e-2);
    }
}
