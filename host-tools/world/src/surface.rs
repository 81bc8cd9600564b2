//! One sample of a texture: a profile of heights, made from its spectrum, and friction along it.

use std::f64::consts::TAU;

use super::maths::{exp, ln, pow, sin, sin_cos, square};
use super::noise::Noise;
use super::textures::{CLAMPED_N, Texture};

/// Length of a sample, mm (PAPER: squares of 75 mm).
pub(crate) const LENGTH_MM: f64 = 75.0;
/// Distance of the profile's points, mm (chosen: half of what the finest asperities need).
pub(crate) const POINT_MM: f64 = 0.005;
/// Points of the profile: a power of two that covers the sample and half a contact patch at either end.
const POINTS: usize = 1 << 14;
/// Beginning of the profile, mm: it covers -3.46 .. 78.46 mm.
const START_MM: f64 = (LENGTH_MM - POINTS as f64 * POINT_MM) / 2.0;

/// Shortest wavelength that the silicone of the skin follows into the valleys, mm (chosen: a quarter of a ridge).
const FOLLOWED_MM: f64 = 0.1;
/// Relative width of the band of the finest asperities (chosen).
const FINE_WIDTH: f64 = 0.3;
/// Distance over which local amplitude and friction wander, mm (chosen: several times the contact patch).
const WANDER_MM: f64 = 8.0;
/// Points of the slow variations, at both ends of every piece.
const SLOW_POINTS: usize = 83;
/// Distance of those points, mm.
const SLOW_MM: f64 = 1.0;

/// Load and speed at which a texture's friction is quoted, N and mm/s (chosen: the force that suits traction best in
/// the paper, and the middle of its speeds).
pub(crate) const FRICTION_AT: (f64, f64) = (1.26, 25.1);
/// Load and speed at which its vibrations are, N and mm/s (chosen: the paper's movement between the others).
pub(crate) const VIBRATIONS_AT: (f64, f64) = (0.5, 25.1);
/// Lowest load and speed of the laws of both, N and mm/s (chosen: below them they stay as they are there).
const LAWS_FROM: (f64, f64) = (0.05, 5.0);
/// Distance from the quoted point at which the laws bend, in ln(speed) (chosen: about over the speeds of the paper's
/// three movements).
const BENDS: f64 = 1.0;

impl Texture {
    /// Coefficient of kinetic friction of the skin, mean over a sample: see [`Surface::friction`].
    pub(super) fn mean_friction(&self, speed_mm_s: f64, load_n: f64) -> f64 {
        self.friction * self.law(speed_mm_s, load_n)
    }

    /// Friction relative to that at [`FRICTION_AT`].
    fn law(&self, speed_mm_s: f64, load_n: f64) -> f64 {
        let [load, speed] = relative([load_n, speed_mm_s.abs()], FRICTION_AT);
        let of_speed = bent(self.friction_speed, self.friction_bend, speed);
        exp(self.friction_load * load + of_speed)
    }

    /// Vibrations relative to those at [`VIBRATIONS_AT`], but for what speed does to those of all textures.
    pub(super) fn vibrations(&self, speed_mm_s: f64) -> f64 {
        let [_, speed] = relative([0.0, speed_mm_s], VIBRATIONS_AT);
        exp(bent(self.vibration_speed, self.vibration_bend, speed))
    }

    /// Share of the vibrations that passes under a load, the skin being clamped the more it is pressed: at
    /// [`VIBRATIONS_AT`] all textures' alike.
    pub(super) fn passed(&self, load_n: f64) -> f64 {
        let of = |clamped_n: f64, load_n: f64| 1.0 / (1.0 + load_n / clamped_n);
        let here = of(self.clamped_n, load_n) / of(self.clamped_n, VIBRATIONS_AT.0);
        // never higher than the surface is
        (here * of(CLAMPED_N.0, VIBRATIONS_AT.0)).min(1.0)
    }

    /// Centre of the spectrum of the impulses, Hz.
    pub(super) fn impulse_centre_hz(&self, speed_mm_s: f64, load_n: f64) -> f64 {
        let [load, speed] = relative([load_n, speed_mm_s], VIBRATIONS_AT);
        self.impulse_hz * exp(self.impulse_load * load + bent(0.0, self.impulse_bend, speed))
    }
}

/// ln of load and speed relative to those at which something is quoted.
fn relative([load_n, speed_mm_s]: [f64; 2], at: (f64, f64)) -> [f64; 2] {
    [
        ln(load_n.max(LAWS_FROM.0) / at.0),
        ln(speed_mm_s.max(LAWS_FROM.1) / at.1),
    ]
}

/// A power law that bends up to [`BENDS`] from where it is quoted: ln of its value at ln(speed).
fn bent(power: f64, bend: f64, speed: f64) -> f64 {
    power * speed + bend * square(speed.clamp(-BENDS, BENDS))
}

/// One sample of a texture, 75 mm long in the direction of the slide.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    pub(super) texture: Texture,
    /// heights, um: the skin feels those that it follows
    #[cfg(test)]
    height: Vec<f32>,
    /// the part of them that the skin follows, um: looked up all the time, so that its length is known while compiling
    followed: Box<[f32; POINTS]>,
    /// rms of the part that it does not follow, um
    pub(super) unresolved_um: f64,
    /// friction relative to the texture's, every [`SLOW_MM`]
    friction: Vec<f64>,
    /// amplitude relative to the texture's, every [`SLOW_MM`]
    amplitude: Vec<f64>,
}

impl Surface {
    /// Cuts a sample of `texture`, as heterogeneous as [`Conditions::variation`](super::Conditions::variation) has it.
    pub(crate) fn new(texture: &Texture, seed: u64, variation: f64) -> Self {
        let mut noise = Noise::new(seed, 1000 + u64::from(texture.number));
        let deviation = variation * texture.heterogeneity;
        let amplitude = wandering(&mut noise, deviation);
        // friction varies less than heights do: chosen
        let friction = wandering(&mut noise, 0.4 * deviation);

        let mut coarse = random_profile(&mut noise, |wavelength_mm| texture.relief(wavelength_mm));
        scale_to_rms(&mut coarse, texture.relief_um);
        add_weave(&mut coarse, texture, &mut noise);
        let mut fine = random_profile(&mut noise, |wavelength_mm| {
            let x = ln(wavelength_mm / texture.fine_mm) / FINE_WIDTH;
            exp(-0.5 * x * x)
        });
        scale_to_rms(&mut fine, texture.fine_um);

        let height: Vec<f32> = coarse
            .iter()
            .zip(&fine)
            .enumerate()
            .map(|(i, (coarse, fine))| {
                let local = slow(&amplitude, START_MM + i as f64 * POINT_MM);
                (local * (coarse + fine)) as f32
            })
            .collect();
        let followed = smooth(&height, FOLLOWED_MM);
        let rest = height
            .iter()
            .zip(&followed)
            .map(|(h, f)| square(f64::from(h - f)));
        let unresolved_um = (rest.sum::<f64>() / POINTS as f64).sqrt();
        Self {
            texture: texture.clone(),
            #[cfg(test)]
            height,
            followed: followed.try_into().expect("a profile has so many points"),
            unresolved_um,
            friction,
            amplitude,
        }
    }

    /// Height at `x_mm` along the sample, um about its mean.
    #[cfg(test)]
    pub(crate) fn height_um(&self, x_mm: f64) -> f64 {
        let (i, rest) = place(x_mm);
        let [a, b] = [0, 1].map(|k| f64::from(self.height[(i + k) % POINTS]));
        a + (b - a) * rest
    }

    /// Coefficient of kinetic friction of the skin at `x_mm`, sliding at `speed_mm_s` under `load_n`: a power law of
    /// both.
    pub(crate) fn friction(&self, x_mm: f64, speed_mm_s: f64, load_n: f64) -> f64 {
        self.texture.friction * slow(&self.friction, x_mm) * self.texture.law(speed_mm_s, load_n)
    }

    /// Local amplitude of heights relative to the whole sample's.
    pub(super) fn amplitude(&self, x_mm: f64) -> f64 {
        slow(&self.amplitude, x_mm)
    }

    /// Mean height, um, that the skin follows about `x_mm`, with the pressure of a Hertz contact `half_mm` to either
    /// side (at most 3.4), taken at points `pitch_mm` (a multiple of [`POINT_MM`]) apart of which every second, the
    /// first at `x_mm`, carries 1 + `contrast` and the others 1 - `contrast`.
    pub(super) fn contact_um(&self, x_mm: f64, half_mm: f64, pitch_mm: f64, contrast: f64) -> f64 {
        let (i, rest) = place(x_mm);
        let stride = (pitch_mm / POINT_MM).round() as usize;
        let (left, right) = (1.0 - rest, rest);
        let at = |k: usize| {
            f64::from(self.followed[k % POINTS]) * left
                + f64::from(self.followed[(k + 1) % POINTS]) * right
        };
        let mut carried = 1.0 + contrast;
        let mut sum = carried * at(i);
        let mut weights = carried;
        let scale = square(pitch_mm / half_mm);
        let mut k = 1_usize;
        loop {
            let pressure = 1.0 - scale * (k * k) as f64;
            if pressure <= 0.0 {
                return sum / weights;
            }
            carried = 2.0 - carried;
            let weight = carried * pressure;
            sum += weight * (at(i + k * stride) + at(i + POINTS - k * stride));
            weights += 2.0 * weight;
            k += 1;
        }
    }
}

/// Point before `x_mm` and how far beyond it that is, in points.
fn place(x_mm: f64) -> (usize, f64) {
    let x = ((x_mm - START_MM) / POINT_MM).clamp(0.0, (POINTS - 1) as f64);
    let i = x as usize;
    (i, x - i as f64)
}

/// Linear between the points of a slow variation.
fn slow(points: &[f64], x_mm: f64) -> f64 {
    let x = ((x_mm - START_MM) / SLOW_MM).clamp(0.0, (SLOW_POINTS - 2) as f64);
    let i = x as usize;
    points[i] + (points[i + 1] - points[i]) * (x - i as f64)
}

/// A factor about 1 that wanders along the sample: log-normal with this deviation.
fn wandering(noise: &mut Noise, deviation: f64) -> Vec<f64> {
    let memory = exp(-SLOW_MM / WANDER_MM);
    let mut x = noise.normal();
    (0..SLOW_POINTS)
        .map(|_| {
            x = memory * x + (1.0 - memory * memory).sqrt() * noise.normal();
            exp(deviation * x)
        })
        .collect()
}

/// A random profile with the given relative power density over spatial frequency, as a function of the wavelength in
/// mm.
fn random_profile(noise: &mut Noise, density: impl Fn(f64) -> f64) -> Vec<f64> {
    let length_mm = POINTS as f64 * POINT_MM;
    let (mut re, mut im) = (vec![0.0; POINTS], vec![0.0; POINTS]);
    for k in 1..POINTS / 2 {
        let amplitude = density(length_mm / k as f64).sqrt();
        re[k] = amplitude * noise.normal();
        im[k] = amplitude * noise.normal();
    }
    // the real part of the one-sided sum is the profile
    fourier(&mut re, &mut im);
    re
}

/// Scales a profile of mean 0 to this rms.
fn scale_to_rms(profile: &mut [f64], rms: f64) {
    let power = profile.iter().map(|h| h * h).sum::<f64>() / profile.len() as f64;
    let factor = if power > 0.0 { rms / power.sqrt() } else { 0.0 };
    profile.iter_mut().for_each(|h| *h *= factor);
}

/// Adds the periodic part: harmonics that fall off as 1/k^n, with a period that wanders by the texture's jitter.
fn add_weave(profile: &mut [f64], texture: &Texture, noise: &mut Noise) {
    let Some(weave) = texture.weave else { return };
    let phases: Vec<f64> = (0..weave.harmonics)
        .map(|_| TAU * noise.uniform())
        .collect();
    let falls: Vec<f64> = (1..=weave.harmonics)
        .map(|k| pow(f64::from(k), -weave.falloff))
        .collect();
    // a sine of amplitude a has power a^2 / 2
    let scale = weave.rms_um / (falls.iter().map(|a| a * a / 2.0).sum::<f64>()).sqrt();
    let per_period = (weave.wavelength_mm / POINT_MM).round().max(1.0) as usize;
    let mut step = TAU * POINT_MM / weave.wavelength_mm;
    let mut phase = TAU * noise.uniform();
    for (i, height) in profile.iter_mut().enumerate() {
        if i % per_period == 0 {
            step = TAU * POINT_MM / weave.wavelength_mm * (1.0 + weave.jitter * noise.normal());
        }
        phase += step;
        for (k, (fall, offset)) in falls.iter().zip(&phases).enumerate() {
            *height += scale * fall * sin((k + 1) as f64 * phase + offset);
        }
    }
}

/// The rest of a profile without wavelengths below `shortest_mm`: two running means of half of it.
fn smooth(profile: &[f32], shortest_mm: f64) -> Vec<f32> {
    let half = (shortest_mm / 4.0 / POINT_MM).round() as usize;
    let n = profile.len();
    let mean = |p: &[f32]| -> Vec<f32> {
        let at = |i: usize| f64::from(p[i % n]);
        let mut sum: f64 = (0..=2 * half).map(|j| at(n - half + j)).sum();
        (0..n)
            .map(|i| {
                let mean = sum / (2 * half + 1) as f64;
                sum += at(i + half + 1) - at(i + n - half);
                mean as f32
            })
            .collect()
    };
    mean(&mean(profile))
}

/// Fourier transform in place, radix 2.
fn fourier(re: &mut [f64], im: &mut [f64]) {
    let n = re.len();
    let bits = n.trailing_zeros();
    for i in 0..n {
        let j = i.reverse_bits() >> (usize::BITS - bits);
        if i < j {
            re.swap(i, j);
            im.swap(i, j);
        }
    }
    let mut half = 1;
    while half < n {
        for k in 0..half {
            let (sin, cos) = sin_cos(TAU / 2.0 * k as f64 / half as f64);
            for a in (k..n).step_by(2 * half) {
                let b = a + half;
                let (r, i) = (re[b] * cos - im[b] * sin, re[b] * sin + im[b] * cos);
                (re[b], im[b]) = (re[a] - r, im[a] - i);
                (re[a], im[a]) = (re[a] + r, im[a] + i);
            }
        }
        half *= 2;
    }
}
