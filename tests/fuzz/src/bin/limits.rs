//! Attacks every target for some seconds with inputs that are nearly right, then with 10 MB each: no panic, no more
//! than 256 MB of memory, no more than 10 s. The same inputs every time: `limits SECONDS [TARGET]...`.

use std::any::Any;
use std::panic::catch_unwind;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use tactus_fuzz::memory::{Counting, most_of};
use tactus_fuzz::{TARGETS, Target, many_rows, many_slides, seeds};

#[global_allocator]
static MEMORY: Counting = Counting;

const MOST_BYTES: usize = 256 << 20;
const LONGEST: Duration = Duration::from_secs(10);
/// Bytes of a large input.
const LARGE: usize = 10_000_000;
/// Most bytes of an input that is nearly right.
const SMALL: usize = 8192;
/// What breaks parsers of text, and of numbers in it.
const WORDS: [&[u8]; 14] = [
    b"",
    b"\0",
    b"\xff\xff\xff\xff",
    b"\"",
    b"[",
    b"{",
    b",",
    b"\n",
    b"-1",
    b"1e999",
    b"NaN",
    b"99999999999",
    b"18446744073709551616",
    b"\x1b]0;",
];
/// What large inputs are full of.
const FILLING: [&[u8]; 9] = [
    b"\0", b"\xff", b"[", b"{\"\":", b"\"", b",", b"\n", b"9", b"a,\n",
];

/// Random numbers (xorshift, Marsaglia 2003).
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % end.max(1) as u64) as usize
    }

    fn range(&mut self, length: usize) -> std::ops::Range<usize> {
        let from = self.below(length + 1);
        from..from + self.below((length - from).min(64) + 1)
    }

    /// An input with a few changes.
    fn changed(&mut self, all: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = all[self.below(all.len())].clone();
        for _ in 0..=self.below(6) {
            let range = self.range(bytes.len());
            match self.below(6) {
                0 if !bytes.is_empty() => {
                    let at = self.below(bytes.len());
                    bytes[at] ^= 1 << self.below(8);
                }
                1 => drop(bytes.drain(range)),
                2 => {
                    let again = bytes[range.clone()].repeat(1 + self.below(20));
                    bytes.splice(range.end..range.end, again);
                }
                3 => {
                    let other = &all[self.below(all.len())];
                    let from = self.range(other.len());
                    bytes.splice(range, other[from].iter().copied());
                }
                4 => {
                    let any: Vec<u8> = range.clone().map(|_| self.below(256) as u8).collect();
                    bytes.splice(range, any);
                }
                _ => {
                    let word = WORDS[self.below(WORDS.len())];
                    bytes.splice(range, word.iter().copied());
                }
            }
        }
        bytes.truncate(SMALL);
        bytes
    }
}

/// Inputs of 10 MB: a part of a right one again and again, where it stands, and what any format chokes on.
fn large(name: &str, seeds: &[Vec<u8>]) -> impl Iterator<Item = Vec<u8>> {
    let mut random = Random(1);
    let parts = seeds.iter().take(4).flat_map(|seed| {
        let length = seed.len();
        let mut lines = (0..length).filter(|&at| seed[at] == b'\n').map(|at| at + 1);
        let (first, second) = (lines.next().unwrap_or(0), lines.next().unwrap_or(length));
        let ranges = [
            1.min(length)..length,
            first..length,
            first..second,
            random.range(length),
        ];
        ranges.map(|range| (seed.clone(), range))
    });
    let parts: Vec<_> = parts.filter(|(_, range)| !range.is_empty()).collect();
    let repeated = parts.into_iter().map(|(seed, range)| {
        let times = LARGE / range.len();
        [
            &seed[..range.start],
            &seed[range.clone()].repeat(times),
            &seed[range.end..],
        ]
        .concat()
    });
    let heads: Vec<Vec<u8>> = seeds
        .iter()
        .take(4)
        .map(|seed| seed[..seed.len() / 2].to_vec())
        .collect();
    let filled = heads.into_iter().flat_map(|head| {
        FILLING.map(|filling| [&head, filling.repeat(LARGE / filling.len()).as_slice()].concat())
    });
    let rows = match name {
        "recordings" => many_rows(LARGE),
        "import" => many_slides(LARGE),
        _ => Vec::new(),
    };
    repeated.chain(filled).chain(rows)
}

/// Why the target must not do this with the input.
fn fault((_, run): Target, input: &[u8]) -> Option<String> {
    let began = Instant::now();
    let mut done = Ok(());
    let most = most_of(|| done = catch_unwind(|| run(input)));
    let took = began.elapsed();
    match done {
        Err(panic) => Some(format!("it panics: {}", said(&*panic))),
        Ok(()) if most > MOST_BYTES => Some(format!("it takes {} MB", most >> 20)),
        Ok(()) if took > LONGEST => Some(format!("it takes {:.1} s", took.as_secs_f64())),
        Ok(()) => None,
    }
}

fn said(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied())
        .unwrap_or("no words")
}

/// What is wrong with a target, with the input in a file.
fn attack(target: Target, time: Duration) -> Result<String, String> {
    let (name, _) = target;
    let seeds = seeds(name);
    let kept = |why: String, input: &[u8]| {
        let file = std::env::temp_dir().join(format!("tactus-fuzz-{name}.bin"));
        let there = std::fs::write(&file, input).map(|()| file.display().to_string());
        format!(
            "{name}: {why}; the input of {} bytes is in {there:?}",
            input.len()
        )
    };
    let (mut random, mut small, began) = (Random(41), 0, Instant::now());
    while began.elapsed() < time {
        let input = random.changed(&seeds);
        if let Some(why) = fault(target, &input) {
            return Err(kept(why, &input));
        }
        small += 1;
    }
    let (mut many, mut longest) = (0, Duration::ZERO);
    for input in large(name, &seeds) {
        let began = Instant::now();
        if let Some(why) = fault(target, &input) {
            return Err(kept(why, &input));
        }
        (many, longest) = (many + 1, longest.max(began.elapsed()));
    }
    let longest = longest.as_secs_f64();
    Ok(format!(
        "{name}: {small} small inputs, {many} of 10 MB, the longest {longest:.1} s"
    ))
}

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let Some(seconds) = arguments.next().and_then(|text| text.parse().ok()) else {
        eprintln!("limits SECONDS [TARGET]...");
        return ExitCode::FAILURE;
    };
    let wanted: Vec<String> = arguments.collect();
    let mut code = ExitCode::SUCCESS;
    for target in TARGETS
        .into_iter()
        .filter(|(name, _)| wanted.is_empty() || wanted.iter().any(|w| w == name))
    {
        match attack(target, Duration::from_secs(seconds)) {
            Ok(line) => println!("{line}"),
            Err(why) => {
                println!("FAILED {why}");
                code = ExitCode::FAILURE;
            }
        }
    }
    code
}
