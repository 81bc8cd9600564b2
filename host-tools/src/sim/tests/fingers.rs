//! One vibration and one force through every finger's transducers, parts, wire and decoder: what comes out agrees.

use std::f64::consts::TAU;

use tactus_core::sensor::pressure::{Channel, SLOTS_HZ};
use tactus_core::sensor::{FingerModel, FingerName};

use crate::sim::conditions::TICK_S;
use crate::sim::finger::{Felt, Finger, Held, PA_PER_N};
use crate::sim::parts::Peers;
use crate::sim::slot::Reader;

/// What comes out: counts of P_AC and of P_DC with the times of their slots, s since the signal began.
type Heard = [Vec<(f64, f64)>; 2];

/// A finger on its bus, without a contact, that feels this force and this vibration, N, at each time, s.
struct Wire {
    finger: Finger,
    peers: Peers,
    reader: Reader,
    ticks: u64,
}

/// The finger is switched on so long before a signal begins, s: a BioTac starts, and filters fill.
const BEFORE_S: f64 = 0.6;

impl Wire {
    fn new(name: FingerName) -> Self {
        let finger = Finger::new(1).of(name, 1);
        Self {
            peers: Peers::new(&finger, 1),
            finger,
            reader: Reader::new(name),
            ticks: 0,
        }
    }

    /// Lets time pass; how far it then is into a tick.
    fn advance(&mut self, now_s: f64, signal: &impl Fn(f64) -> [f64; 2]) -> f64 {
        while self.ticks as f64 * TICK_S <= now_s {
            self.ticks += 1;
            let at_s = self.ticks as f64 * TICK_S;
            let [force_n, vibration_n] = signal(at_s - BEFORE_S);
            self.finger.feed(&Felt {
                fluid_pa: PA_PER_N * vibration_n,
                slow_pa: PA_PER_N * force_n,
                force_n,
                vibration_n,
                shear_n: 0.0,
                held: Held::STILL,
            });
            self.peers.tick((1e9 * at_s) as u64, &self.finger);
        }
        (now_s / TICK_S).fract()
    }

    fn hear(mut self, seconds: f64, signal: impl Fn(f64) -> [f64; 2]) -> Heard {
        let mut reader = self.reader.clone();
        let mut transact = |begins_ns: u64, part, mode, mosi: &[u8], miso: &mut [u8]| {
            let fraction = self.advance(1e-9 * begins_ns as f64, &signal);
            self.peers.select(begins_ns, part, mode);
            for (mosi, miso) in mosi.iter().zip(miso.iter_mut()) {
                *miso = self
                    .peers
                    .byte(begins_ns, *mosi, &mut self.finger, fraction);
            }
            if let Peers::BioTac(sensor) = &mut self.peers {
                let line = *sensor.line();
                miso.iter_mut().zip(line).for_each(|(to, from)| *to = from);
            }
            self.peers.deselect(begins_ns + 3_000);
        };
        let began_ns = 1_000_000 * u64::from(reader.power_up_ms());
        reader
            .start_up(began_ns, |transfer, mosi, miso| {
                transact(transfer.begins_ns, transfer.part, transfer.mode, mosi, miso);
            })
            .unwrap();
        let mut heard = Heard::default();
        for n in 0..((BEFORE_S + seconds - 0.15) * f64::from(SLOTS_HZ)) as u64 {
            let at_s = 0.15 + n as f64 / f64::from(SLOTS_HZ);
            let word = reader.word_of_slot(n, (1e9 * at_s) as u64, |transfer, mosi, miso| {
                transact(transfer.begins_ns, transfer.part, transfer.mode, mosi, miso);
            });
            let since_s = at_s - BEFORE_S;
            if let Some(word) = word.filter(|_| since_s >= 0.0) {
                heard[word.channel as usize].push((since_s, f64::from(word.counts.get())));
            }
        }
        assert_eq!(self.peers.complaints(), 0);
        heard
    }
}

/// Counts of P_AC for each newton, or g.
fn pac_per_unit(model: &FingerModel) -> f64 {
    match model.name {
        // the accelerometer's pascals are mg
        FingerName::Mems => 1e3 / f64::from(model.calibration.pac_pa_per_count),
        _ => PA_PER_N / f64::from(model.calibration.pac_pa_per_count),
    }
}

/// Gain, relative to the nominal one, and phase, radians, of a tone of so many counts.
fn tone(name: FingerName, hz: f64, counts: f64) -> (f64, f64) {
    let per_unit = pac_per_unit(Reader::new(name).model());
    let [pac, _] = Wire::new(name).hear(1.0, |s| [0.3, counts / per_unit * (TAU * hz * s).sin()]);
    // whole periods of the last half of it
    let late: Vec<_> = pac.into_iter().filter(|(s, _)| *s >= 0.5).collect();
    let mean = late.iter().map(|(_, c)| c).sum::<f64>() / late.len() as f64;
    let part = |wave: fn(f64) -> f64| {
        let sum: f64 = late
            .iter()
            .map(|(s, c)| (c - mean) * wave(TAU * hz * s))
            .sum();
        2.0 * sum / late.len() as f64
    };
    let (sine, cosine) = (part(f64::sin), part(f64::cos));
    (sine.hypot(cosine) / counts, cosine.atan2(sine))
}

/// Tones with whole periods in half a second.
const TONES_HZ: [f64; 7] = [30.0, 60.0, 120.0, 240.0, 400.0, 560.0, 700.0];

#[test]
fn a_vibration_comes_out_of_all_fingers_alike() {
    for name in FingerName::ALL {
        let at = |hz: f64| tone(name, hz, 400.0);
        let db = |hz: f64| 20.0 * at(hz).0.log10();
        let measured: Vec<_> = TONES_HZ.iter().map(|&hz| at(hz)).collect();
        for ((gain, _), hz) in measured.iter().zip(TONES_HZ) {
            let db = 20.0 * gain.log10();
            // the high-pass takes half a decibel at 30 Hz; the low-passes begin
            assert!((-1.4..0.4).contains(&db), "{name}, {hz} Hz: {db:.2} dB");
        }
        let (low, high) = (db(10.0), db(1_000.0));
        eprintln!("{name}: {low:.2} dB at 10 Hz, {high:.2} dB at 1000 Hz");
        assert!((-3.6..-2.4).contains(&low), "{name}: {low:.2} dB at 10 Hz");
        assert!(
            (-5.5..-2.0).contains(&high),
            "{name}: {high:.2} dB at 1000 Hz"
        );
        // the phase of a delay, once the high-pass's is taken away
        let mut turns = 0.0;
        let mut before = 0.0;
        let phases: Vec<f64> = measured
            .iter()
            .zip(TONES_HZ)
            .map(|((_, phase), hz)| {
                let phase = phase - (10.0 / hz).atan();
                while phase + turns > before + 0.5 {
                    turns -= TAU;
                }
                before = phase + turns;
                before
            })
            .collect();
        let squares: f64 = TONES_HZ.iter().map(|hz| (TAU * hz).powi(2)).sum();
        let both: f64 = TONES_HZ
            .iter()
            .zip(&phases)
            .map(|(hz, p)| TAU * hz * p)
            .sum();
        let delay_s = -both / squares;
        let most = TONES_HZ
            .iter()
            .zip(&phases)
            .map(|(hz, phase)| (phase + TAU * hz * delay_s).abs().to_degrees())
            .fold(0.0, f64::max);
        eprintln!("{name}: {:.3} ms late, {most:.1} degrees", 1e3 * delay_s);
        let expected_ms = if name == FingerName::Mems {
            1.4..2.1
        } else {
            0.0..0.4
        };
        assert!(expected_ms.contains(&(1e3 * delay_s)), "{name}");
        assert!(most < 15.0, "{name}: {most:.1} degrees off a pure delay");
    }
}

#[test]
fn a_force_comes_out_of_all_fingers_alike() {
    for name in FingerName::ALL {
        let model = Reader::new(name).model();
        let step_s = 0.5;
        let [_, pdc] = Wire::new(name).hear(1.0, |s| [f64::from(u8::from(s >= step_s)), 0.0]);
        let mean = |from_s: f64, to_s: f64| {
            let part: Vec<f64> = pdc
                .iter()
                .filter(|(s, _)| (from_s..to_s).contains(s))
                .map(|(_, c)| *c)
                .collect();
            part.iter().sum::<f64>() / part.len() as f64
        };
        let (rest, pressed) = (mean(0.0, step_s), mean(0.7, 1.0));
        let mn = (pressed - rest) * f64::from(model.calibration.force_mn_per_count);
        let half = f64::midpoint(rest, pressed);
        let (at_s, _) = pdc.iter().find(|(s, c)| *s >= step_s && *c > half).unwrap();
        let late_ms = 1e3 * (at_s - step_s);
        eprintln!("{name}: {mn:.1} mN, {late_ms:.2} ms late, at rest {rest:.0} counts");
        assert!((mn - 1000.0).abs() < 10.0, "{name}: {mn:.1} mN");
        assert!((0.0..3.0).contains(&late_ms), "{name}: {late_ms} ms");
        let (least, most) = model.at_rest.pdc_counts;
        assert!(
            (f64::from(least)..f64::from(most)).contains(&rest),
            "{name}"
        );
    }
}

#[test]
fn fingers_at_rest_are_as_their_models_say() {
    for name in FingerName::ALL {
        let model = Reader::new(name).model();
        let heard = Wire::new(name).hear(1.0, |_| [0.0, 0.0]);
        for (channel, counts) in Channel::PATTERN.into_iter().zip(&heard) {
            assert!(
                counts.len() >= 2198,
                "{name}, {channel:?}: {}",
                counts.len()
            );
        }
        let [pac, _] = heard;
        let mean = pac.iter().map(|(_, c)| c).sum::<f64>() / pac.len() as f64;
        let rms =
            (pac.iter().map(|(_, c)| (c - mean).powi(2)).sum::<f64>() / pac.len() as f64).sqrt();
        let (least, most) = model.at_rest.pac_noise_counts;
        eprintln!("{name}: noise {rms:.2} counts");
        assert!(
            (f64::from(least)..f64::from(most)).contains(&rms),
            "{name}: {rms}"
        );
        assert!((mean - 2048.0).abs() < 60.0, "{name}: {mean}");
    }
}
