//! The sensor's signals in the report: figs. 3 and 4.

use serde_json::json;

use super::model::{Report, cells};
use crate::chart::{COLOURS, Chart, DrawError, Figure, Mark, Series, buffer};
use crate::signals::{Example, PAPER_LINE, Press, Signals};

/// Adds figs. 3 and 4.
pub(super) fn add(signals: &Signals, report: &mut Report) -> Result<(), DrawError> {
    let press = &signals.press;
    let rows = vec![
        cells![
            "slope, mN a count",
            (press.mn_per_count, 2),
            (PAPER_LINE.0, 1)
        ],
        cells!["R\u{b2}", (press.r_squared, 4), (PAPER_LINE.1, 3)],
    ];
    report.table("fig3-line", &["", "here", "paper"], rows);
    report.figures.insert("fig3", vec![fig3(press)?]);
    let mut panels = Vec::new();
    for example in &signals.slides {
        panels.extend([signal(example)?, spectrum(example)?, traction(example)?]);
    }
    report.figures.insert("fig4", panels);
    report.words.insert("signals", json!({}));
    Ok(())
}

/// Force against P_DC.
fn fig3(press: &Press) -> Result<Figure, DrawError> {
    let both = press.loading.iter().chain(&press.unloading);
    let end = both.clone().map(|p| p.0).fold(0.0, f64::max);
    let line_end = 2.0 / (press.mn_per_count * 1e-3);
    let line = vec![(0.0, 0.0), (line_end, 2.0)];
    let series = vec![
        Series::points(0, Mark::Circle, "loading", press.loading.clone()),
        Series::points(4, Mark::Cross, "unloading", press.unloading.clone()),
        Series::curve(1, Mark::None, "line below 2 N", line),
    ];
    let title = "Force against P_DC";
    let (x, y) = ("change of P_DC (counts)", "normal force (N)");
    Chart {
        y_range: buffer(both.map(|p| p.1).chain([0.0])),
        ..Chart::new(title, x, y, (-0.02 * end, 1.05 * end), series)
    }
    .figure("fig3")
}

/// P_AC before and behind the band-pass.
fn signal(example: &Example) -> Result<Figure, DrawError> {
    let second = |n: usize| example.from_s + n as f64 / 2200.0;
    let trace = |signal: &[f64]| (0..).map(second).zip(signal.iter().copied()).collect();
    let series = vec![
        Series::curve(4, Mark::None, "P_AC", trace(&example.pac_pa)),
        Series::curve(
            1,
            Mark::None,
            "20\u{2013}700 Hz",
            trace(&example.filtered_pa),
        ),
    ];
    let title = format!("{}: P_AC, and filtered", example.texture);
    let (x, y) = (
        "time from the begin of the slide (s)",
        "dynamic pressure (Pa)",
    );
    let x_range = (second(0), second(example.pac_pa.len()));
    Chart::new(title, x, y, x_range, series)
        .figure(format!("fig4-signal-T{}", example.texture.number))
}

/// The averaged spectrum, and its centroid.
fn spectrum(example: &Example) -> Result<Figure, DrawError> {
    let bins = (0..).map(|k| f64::from(k) * f64::from(example.bin_hz));
    let power = example.spectrum_pa2.iter().map(|p| (p + 1e-4).log10());
    let centroid = f64::from(example.centroid_hz);
    let series = vec![Series::curve(0, Mark::None, "", bins.zip(power).collect())];
    let title = format!("{}: spectrum", example.texture);
    let (x, y) = ("frequency (Hz)", "power per bin (log of Pa\u{b2})");
    let mut chart = Chart::new(title, x, y, (0.0, 1100.0), series);
    let (low, high) = chart.y_range;
    chart.series.push(Series {
        colour: COLOURS[1],
        ..Series::dashed(
            format!("centroid {centroid:.0} Hz"),
            vec![(centroid, low), (centroid, high)],
        )
    });
    chart.figure(format!("fig4-spectrum-T{}", example.texture.number))
}

/// Traction over the steady part.
fn traction(example: &Example) -> Result<Figure, DrawError> {
    let seconds = (0..).map(|n| example.steady_from_s + 0.02 * f64::from(n));
    let shear: Vec<_> = seconds.zip(example.shear_n.iter().copied()).collect();
    let x_range = buffer(shear.iter().map(|p| p.0));
    let y_range = (
        0.0,
        1.2 * example.shear_n.iter().copied().fold(0.0, f64::max),
    );
    let title = format!("{}: traction", example.texture);
    let (x, y) = ("time from the begin of the slide (s)", "traction (N)");
    let series = vec![Series::curve(2, Mark::None, "", shear)];
    Chart {
        y_range,
        ..Chart::new(title, x, y, x_range, series)
    }
    .figure(format!("fig4-traction-T{}", example.texture.number))
}
