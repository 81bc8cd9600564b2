//! Tests that one vibration and one force through every finger's transducers, parts, wire and decoder give the same
//! result.

use std::f64::consts::TAU;

use tactus_core::sensor::pressure::{Channel, SLOTS_HZ};
use tactus_core::sensor::{FingerModel, FingerName};

use crate::conditions::TICK_S;
use crate::finger::{Finger, Held, PA_PER_N, Stimulus};
use crate::parts::Peers;
use crate::slot::Reader;

/// The decoder's output: counts of P_AC and of P_DC with the times of their slots, s since the signal began.
type Decoded = [Vec<(f64, f64)>; 2];

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
            self.finger.feed(&Stimulus {
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

    fn hear(mut self, seconds: f64, signal: impl Fn(f64) -> [f64; 2]) -> Decoded {
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
        let mut heard = Decoded::default();
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

/// Tones with whole periods in half a second, Hz: those of the band, and of its ends.
const TONES_HZ: [f64; 7] = [30.0, 60.0, 120.0, 240.0, 400.0, 560.0, 700.0];
const ENDS_HZ: [f64; 4] = [10.0, 20.0, 850.0, 1000.0];
/// Time when the force steps from 0 to 1 N, s.
const STEP_S: f64 = 0.5;

struct Vibration {
    name: FingerName,
    /// Frequency, Hz, gain, dB, and phase in radians without that of the high-pass, going on from the one before.
    tones: Vec<(f64, f64, f64)>,
    /// Delay by the phases from 30 to 700 Hz.
    delay_s: f64,
}

impl Vibration {
    fn of(name: FingerName) -> Self {
        let mut all = [&TONES_HZ[..], &ENDS_HZ].concat();
        all.sort_by(f64::total_cmp);
        let mut before = 0.0;
        let tones = all.into_iter().map(|hz| {
            let (gain, phase) = tone(name, hz, 400.0);
            let mut phase = phase - (10.0 / hz).atan();
            while phase > before + 0.5 {
                phase -= TAU;
            }
            before = phase;
            (hz, 20.0 * gain.log10(), phase)
        });
        let tones: Vec<_> = tones.collect();
        let band = tones.iter().filter(|(hz, ..)| TONES_HZ.contains(hz));
        let (squares, both) = band.fold((0.0, 0.0), |(squares, both), (hz, _, phase)| {
            (squares + (TAU * hz).powi(2), both + TAU * hz * phase)
        });
        Self {
            name,
            tones,
            delay_s: -both / squares,
        }
    }

    fn db(&self, hz: f64) -> f64 {
        let tone = self.tones.iter().find(|tone| tone.0 == hz);
        tone.unwrap().1
    }

    fn is_as_promised(&self) {
        let name = self.name;
        for hz in TONES_HZ {
            // the high-pass takes half a decibel at 30 Hz; the low-passes begin
            let db = self.db(hz);
            assert!((-1.4..0.4).contains(&db), "{name}, {hz} Hz: {db:.2} dB");
        }
        let (low, high) = (self.db(10.0), self.db(1000.0));
        assert!((-3.6..-2.4).contains(&low), "{name}: {low:.2} dB at 10 Hz");
        assert!(
            (-5.5..-2.0).contains(&high),
            "{name}: {high:.2} dB at 1000 Hz"
        );
        let band = self.tones.iter().filter(|(hz, ..)| TONES_HZ.contains(hz));
        let off = band.map(|(hz, _, phase)| (phase + TAU * hz * self.delay_s).abs());
        let most = off.fold(0.0, f64::max).to_degrees();
        let late_ms = 1e3 * self.delay_s;
        let expected_ms = if name == FingerName::Mems {
            1.4..2.1
        } else {
            0.0..0.4
        };
        assert!(expected_ms.contains(&late_ms), "{name}");
        assert!(most < 15.0, "{name}: {most:.1} degrees off a pure delay");
    }
}

/// A step of force comes out of a finger as its model says.
fn step(name: FingerName) {
    let model = Reader::new(name).model();
    let [_, pdc] = Wire::new(name).hear(1.0, |s| [f64::from(u8::from(s >= STEP_S)), 0.0]);
    let mean = |from_s: f64, to_s: f64| {
        let part: Vec<f64> = pdc
            .iter()
            .filter(|(s, _)| (from_s..to_s).contains(s))
            .map(|(_, c)| *c)
            .collect();
        part.iter().sum::<f64>() / part.len() as f64
    };
    let (rest, pressed) = (mean(0.0, STEP_S), mean(0.7, 1.0));
    let mn_per_count = f64::from(model.calibration.force_mn_per_count);
    let mn = (pressed - rest) * mn_per_count;
    let half = f64::midpoint(rest, pressed);
    let (at_s, _) = pdc.iter().find(|(s, c)| *s >= STEP_S && *c > half).unwrap();
    let late_ms = 1e3 * (at_s - STEP_S);
    assert!((mn - 1000.0).abs() < 10.0, "{name}: {mn:.1} mN");
    assert!((0.0..3.0).contains(&late_ms), "{name}: {late_ms} ms");
    let (least, most) = model.at_rest.pdc_counts;
    let at_rest = f64::from(least)..f64::from(most);
    assert!(at_rest.contains(&rest), "{name}");
}

#[test]
fn a_vibration_and_a_force_come_out_of_all_fingers_alike() {
    let vibrations = FingerName::ALL.map(Vibration::of);
    vibrations.iter().for_each(Vibration::is_as_promised);
    FingerName::ALL.into_iter().for_each(step);
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
        assert!(
            (f64::from(least)..f64::from(most)).contains(&rms),
            "{name}: {rms}"
        );
        assert!((mean - 2048.0).abs() < 60.0, "{name}: {mean}");
    }
}
