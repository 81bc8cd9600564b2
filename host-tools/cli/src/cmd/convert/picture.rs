//! What an MCAP file that was written shows in a viewer, as a picture.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context as _;
use mcap::MessageStream;
use serde_json::Value;
use tactus_study::chart::Figure;
use tactus_study::pictures::channels::{Trace, figure};

/// Panels and their curves, a channel and a field each: those of `docs/plotjuggler.xml`.
pub(super) const PANELS: [(&str, &[&str]); 3] = [
    ("P_AC", &["/pac/counts"]),
    (
        "Rig",
        &["/rig/force_mn", "/rig/speed_mm_s", "/rig/current_ma"],
    ),
    (
        "Posterior",
        &["/posterior/probability", "/features/roughness"],
    ),
];

/// Draws the curves of [`PANELS`] from the file alone, as a viewer does.
pub(super) fn draw(file: &Path) -> anyhow::Result<Figure> {
    let bytes = std::fs::read(file).with_context(|| file.display().to_string())?;
    let curves = PANELS.iter().flat_map(|(_, curves)| *curves).copied();
    let mut points: BTreeMap<&str, Vec<(f64, f64)>> = curves.map(|c| (c, Vec::new())).collect();
    for message in MessageStream::new(&bytes)? {
        let message = message?;
        let topic = &message.channel.topic;
        let wanted = points.iter_mut().filter_map(|(curve, points)| {
            let field = curve.strip_prefix(topic.as_str())?.strip_prefix('/')?;
            Some((field, points))
        });
        let mut content = None;
        for (field, points) in wanted {
            let content = match &mut content {
                Some(content) => content,
                None => content.insert(serde_json::from_slice::<Value>(&message.data)?),
            };
            if let Some(value) = content[field].as_f64() {
                points.push((message.log_time as f64 * 1e-9, value));
            }
        }
    }
    let panels = PANELS.map(|(name, curves)| {
        let traces = curves.iter().map(|&curve| Trace {
            name: curve.to_owned(),
            points: points.remove(curve).unwrap_or_default(),
        });
        (name, traces.collect())
    });
    Ok(figure("The channels of a session", &panels)?)
}
