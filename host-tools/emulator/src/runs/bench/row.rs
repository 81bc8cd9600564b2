//! The table of the counts.

pub(super) struct Row {
    pub(super) kernel: String,
    pub(super) unit: &'static str,
    pub(super) instructions: f64,
    pub(super) gate: Option<f64>,
    /// CMSIS-DSP in an expert's hands (gcc 12, -O3, counted by QEMU), and the floor of the instruction set (estimated).
    pub(super) cmsis: Option<f64>,
    pub(super) floor: Option<f64>,
    /// The chip's result is the plain kernels' to the bit.
    pub(super) equal: bool,
}

impl Row {
    pub(super) fn ok(&self) -> bool {
        self.equal && self.gate.is_none_or(|gate| self.instructions <= gate)
    }
}

pub(super) fn print(rows: &[Row], source: &str) {
    let number = |number: Option<f64>| match number {
        None => "-".into(),
        Some(n) if n < 1000.0 => format!("{n:.1}"),
        Some(n) => format!("{n:.0}"),
    };
    println!(
        "{:48} {:16} {:>12} {:>9} {:>9} {:>6}  {:>9}",
        "kernel", "unit", "instructions", "CMSIS", "floor", "ratio", "gate"
    );
    for row in rows {
        let ratio = row.floor.or(row.cmsis).map(|to| row.instructions / to);
        let verdict = match (row.gate, row.equal) {
            (_, false) => "  DIFFERS from the plain kernels",
            (None, true) => "",
            (Some(_), true) if row.ok() => "  ok",
            (Some(_), true) => "  MISSED",
        };
        println!(
            "{:48} {:16} {:>12} {:>9} {:>9} {:>6}  {:>9}{verdict}",
            row.kernel,
            row.unit,
            number(Some(row.instructions)),
            number(row.cmsis),
            number(row.floor),
            ratio.map_or("-".into(), |ratio| format!("{ratio:.2}")),
            number(row.gate),
        );
    }
    println!(
        "\nInstructions by the core's counter on the emulated board; the slide is {source}; results compared with\n\
         the plain kernels on this PC, to the bit. Ratio: to the floor where one is known, else to CMSIS-DSP."
    );
}
