//! Decode words of a BioTac: what the sensor answers on its SPI bus, and how damage shows.
//!
//! `cargo run -p tactus-core --example decode_words`

use tactus_core::sensor::biotac::{WordError, decode, encode};
use tactus_core::sensor::pressure::{Calibration, Counts};

pub(crate) fn main() {
    // recorded answers, most significant byte first: bits 11 to 5 and a parity bit, bits 4 to 0, two zeros and a parity
    // bit
    let words = [
        ([0x80, 0x01], "P_AC at rest"),
        ([0xA2, 0x08], "P_DC at rest"),
        ([0x81, 0x01], "one flipped bit"),
        ([0xA5, 0x2D], "an error frame: asked too early"),
        ([0xFF, 0xFF], "no sensor"),
    ];
    for (word, what) in words {
        match decode(word) {
            Ok(counts) => println!("{word:02X?}  {:>4} counts  {what}", counts.get()),
            Err(why @ WordError::ErrorFrame(_)) => {
                println!("{word:02X?}  error frame   {what}: {why}")
            }
            Err(why) => println!("{word:02X?}  damaged       {what}: {why}"),
        }
    }

    // and back, as the simulated sensor does it
    let full_scale = Counts::new(4095).expect("12 bits");
    println!("full scale is {:02X?}", encode(full_scale));

    // counts become forces by the calibration of the finger
    let calibration = Calibration::PAPER;
    let pressed = calibration.pdc_no_contact + 43.0;
    let force_n = (pressed - calibration.pdc_no_contact) * calibration.force_mn_per_count / 1000.0;
    println!("43 counts above the air are {force_n:.2} N");
}
