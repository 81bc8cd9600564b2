//! MCAP as `tactus convert` writes it: P_AC, P_DC and shear, of all slides of a session.

use mcap::MessageStream;
use serde_json::Value;

use super::{Piece, Signals, fits, several};
use crate::data::import::on_line;
use crate::data::recording::PAC_RATE_HZ;

/// Longest message of interest, and longest name of a texture, bytes.
const MAX_MESSAGE: usize = 1 << 16;
const MAX_NAME: usize = 256;
/// Samples of P_AC that are further apart than this, s, are of two recordings.
const APART_S: f64 = 0.1;

#[derive(Default)]
struct SessionSamples {
    /// times and counts of P_AC
    pac: Vec<(f64, f64)>,
    pdc: Vec<(f64, f64)>,
    shear: Vec<(f64, f64)>,
    pieces: Vec<Piece>,
    /// the texture that is being trained
    texture: Option<String>,
    still: bool,
}

pub(super) fn read(file: &[u8], most: usize) -> Result<Signals, String> {
    let damaged = |why: mcap::McapError| format!("a damaged MCAP file ({why}); convert it again");
    let mut read = SessionSamples::default();
    for message in MessageStream::new(file).map_err(damaged)? {
        let message = message.map_err(damaged)?;
        let topic = message.channel.topic.as_str();
        let topics = ["/pac", "/pdc", "/shear", "/request"];
        if topics.contains(&topic) && message.data.len() <= MAX_MESSAGE {
            let body: Value = serde_json::from_slice(&message.data)
                .map_err(|why| format!("{topic} is not of `tactus convert` ({why})"))?;
            read.take(topic, message.log_time as f64 * 1e-9, &body);
            several(read.pieces.len())?;
        }
    }
    if read.pac.is_empty() {
        return Err(
            "MCAP without samples of P_AC: log a session with `tactus device stream` on, or save the signal as CSV"
                .to_owned(),
        );
    }
    fits(read.pac.len(), 3, most)?;
    Ok(read.signals())
}

impl SessionSamples {
    fn take(&mut self, topic: &str, at: f64, body: &Value) {
        let number = |key: &str| body[key].as_f64().unwrap_or(f64::NAN);
        match topic {
            // the finger before it slides is no part of the slide
            "/pac" if body["still"].as_bool() == Some(true) => self.still = true,
            "/pac" => {
                let last = self.pac.last();
                if self.still || last.is_none_or(|(before, _)| (at - before).abs() > APART_S) {
                    self.pieces.push(Piece {
                        rows: self.pac.len()..self.pac.len(),
                        texture: self.texture.clone(),
                        ..Piece::default()
                    });
                }
                self.still = false;
                self.pac.push((at, number("counts")));
                if let Some(piece) = self.pieces.last_mut() {
                    piece.rows.end = self.pac.len();
                }
            }
            "/pdc" => self.pdc.push((at, number("counts"))),
            "/shear" => self.shear.push((at, number("mn") * 1e-3)),
            _ => {
                let trained = body["command"]["Train"]["name"].as_str();
                if let Some(name) = trained.filter(|name| name.len() <= MAX_NAME) {
                    self.texture = Some(name.to_owned());
                }
            }
        }
    }

    fn signals(self) -> Signals {
        let (times, counts): (Vec<f64>, Vec<f64>) = self.pac.into_iter().unzip();
        let mut channels = vec![("pac".to_owned(), counts)];
        for (name, slow) in [("pdc", &self.pdc), ("shear", &self.shear)] {
            if !slow.is_empty() {
                channels.push((name.to_owned(), on_line(slow, &times).collect()));
            }
        }
        Signals {
            rate_hz: Some(f64::from(PAC_RATE_HZ)),
            channels,
            pieces: self.pieces,
            kind: "MCAP",
            ..Signals::default()
        }
    }
}
