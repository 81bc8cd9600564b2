//! The flash and its accelerator (RM0090 3.5.1 and 3.5.2): lines of 128 bits that take so many wait states to read, the
//! line in use, the one that is prefetched behind it, 64 lines of instructions and 8 of data that are kept, the least
//! recently used one of them replaced first.
//!
//! A line that the core has to wait for is a miss and is copied to the cache. One that was prefetched in time is not. A
//! read that is under way is finished before any other one. A load goes before a prefetch that has not begun.

/// Bytes of a line.
const LINE: u32 = 16;
/// Lines of the caches.
const INSTRUCTION_LINES: usize = 64;
const DATA_LINES: usize = 8;
/// Fields of FLASH_ACR (RM0090 3.9.1).
const LATENCY: u32 = 0xf;
const PRFTEN: u32 = 1 << 8;
const ICEN: u32 = 1 << 9;
const DCEN: u32 = 1 << 10;

/// Lines that are kept, the latest first.
#[derive(Clone, Debug)]
struct Cache {
    lines: Vec<u32>,
    capacity: usize,
}

impl Cache {
    fn new(capacity: usize) -> Self {
        Self {
            lines: Vec::with_capacity(capacity),
            capacity,
        }
    }

    /// Returns true if it has the line, which then is the latest.
    fn uses(&mut self, line: u32) -> bool {
        let at = self.lines.iter().position(|kept| *kept == line);
        if let Some(at) = at {
            self.lines[..=at].rotate_right(1);
        }
        at.is_some()
    }

    fn has(&self, line: u32) -> bool {
        self.lines.contains(&line)
    }

    fn keep(&mut self, line: u32) {
        if self.capacity == 0 {
            return;
        }
        if self.lines.len() == self.capacity {
            self.lines.pop();
        }
        self.lines.insert(0, line);
    }
}

/// A line that is read ahead of the core.
#[derive(Clone, Copy, Debug)]
struct Ahead {
    line: u32,
    /// The cycle in which its read begins, or began.
    begins: u64,
}

/// The flash as the core sees it.
#[derive(Clone, Debug)]
pub struct Accelerator {
    wait_states: u64,
    prefetches: bool,
    instructions: Cache,
    data: Cache,
    current: Option<u32>,
    ahead: Option<Ahead>,
    /// The first cycle in which the array is free, except for prefetches.
    free: u64,
}

impl Accelerator {
    /// That of the settings in FLASH_ACR, with empty caches.
    pub fn new(acr: u32) -> Self {
        let lines = |enabled, lines| if acr & enabled == 0 { 0 } else { lines };
        Self {
            wait_states: (acr & LATENCY).into(),
            prefetches: acr & PRFTEN != 0,
            instructions: Cache::new(lines(ICEN, INSTRUCTION_LINES)),
            data: Cache::new(lines(DCEN, DATA_LINES)),
            current: None,
            ahead: None,
            free: 0,
        }
    }

    /// Cycles that the core waits for the instruction at an address, which it wants in the cycle `now`.
    pub(super) fn fetch(&mut self, address: u32, now: u64) -> u64 {
        let line = address / LINE;
        if self.current == Some(line) {
            return 0;
        }
        self.current = Some(line);
        let wait = if self.instructions.uses(line) {
            0
        } else {
            let wait = self.bring(line, now);
            if wait > 0 {
                self.instructions.keep(line);
            }
            wait
        };
        let next = line + 1;
        let is_there = |ahead: Ahead| ahead.line == next;
        if self.prefetches && !self.ahead.is_some_and(is_there) && !self.instructions.has(next) {
            self.finish(now + wait);
            let begins = self.free.max(now + wait + 1);
            self.ahead = Some(Ahead { line: next, begins });
        }
        wait
    }

    /// Cycles that the core waits for a line that is in no cache.
    fn bring(&mut self, line: u32, now: u64) -> u64 {
        if let Some(ahead) = self.ahead
            && ahead.line == line
        {
            return (ahead.begins + self.wait_states).saturating_sub(now);
        }
        self.read(now)
    }

    /// Finishes the prefetch that has begun by now; cancels one that has not.
    fn finish(&mut self, now: u64) {
        if let Some(ahead) = self.ahead.take()
            && ahead.begins < now
        {
            self.free = self.free.max(ahead.begins + self.wait_states + 1);
        }
    }

    /// Cycles that the core waits for a read of the array.
    fn read(&mut self, now: u64) -> u64 {
        self.finish(now);
        let begins = self.free.max(now);
        self.free = begins + self.wait_states + 1;
        begins + self.wait_states - now
    }

    /// Cycles that the core waits for data at an address, which it wants in the cycle `now`.
    pub(super) fn load(&mut self, address: u32, now: u64) -> u64 {
        let line = address / LINE;
        if self.data.uses(line) {
            return 0;
        }
        let ahead = self.ahead;
        let wait = self.read(now);
        // a finished prefetch stays, a planned one comes later
        self.ahead = ahead.map(|ahead| match ahead.begins < now {
            true => ahead,
            false => Ahead {
                begins: self.free,
                ..ahead
            },
        });
        self.data.keep(line);
        wait
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEGIN: u32 = 0x0800_0000;

    /// Waits of fetches of lines, each so many cycles after the one before has arrived.
    fn waits(acr: u32, fetches: &[(u32, u64)]) -> Vec<u64> {
        let mut flash = Accelerator::new(acr);
        let mut now = 0;
        let fetched = fetches.iter().map(|(line, after)| {
            now += after;
            let wait = flash.fetch(BEGIN + line * LINE, now);
            now += wait;
            wait
        });
        fetched.collect()
    }

    /// RM0090 3.5.2, figure 5: with 3 wait states four instructions of 32 bits take as long as the next line.
    #[test]
    fn prefetch_hides_the_wait_states_that_the_manual_draws() {
        let straight = [(0, 0), (1, 4), (2, 4), (3, 4)];
        assert_eq!(waits(3, &straight), [3, 3, 3, 3]);
        assert_eq!(waits(3 | PRFTEN, &straight), [3, 0, 0, 0]);
        // at 5 wait states a line takes 6 cycles
        assert_eq!(waits(5 | PRFTEN, &straight), [5, 2, 2, 2]);
        assert_eq!(waits(5 | PRFTEN, &[(0, 0), (1, 8), (2, 8)]), [5, 0, 0]);
    }

    #[test]
    fn a_line_that_was_missed_is_kept_and_the_oldest_goes() {
        let there_and_back = [(0, 0), (7, 1), (0, 1), (7, 1)];
        assert_eq!(waits(5 | ICEN, &there_and_back), [5, 5, 0, 0]);
        assert_eq!(waits(5, &there_and_back), [5, 5, 5, 5]);
        // 64 lines fit, each used again in its turn; of 65 none is there when it is wanted
        for (lines, expected) in [(64, 0), (65, 5)] {
            let round = (0..lines).map(|line| (2 * line, 1));
            let twice: Vec<_> = round.clone().chain(round).collect();
            let second = &waits(5 | ICEN, &twice)[lines as usize..];
            assert!(second.iter().all(|wait| *wait == expected), "{lines}");
        }
    }

    /// A branch away while the next line is read waits for the end of that read, too.
    #[test]
    fn a_read_under_way_is_brought_to_its_end() {
        // line 0 arrives in cycle 5, line 1 is read from 6 to 11; line 9 is wanted in cycle 8, read from 12 on
        assert_eq!(waits(5 | PRFTEN, &[(0, 0), (9, 3)]), [5, 9]);
        assert_eq!(waits(5, &[(0, 0), (9, 3)]), [5, 5]);
    }

    #[test]
    fn data_waits_each_time_without_its_cache() {
        for (acr, expected) in [(5, [5, 5, 5]), (5 | DCEN, [5, 0, 0])] {
            let mut flash = Accelerator::new(acr);
            let loads = [0, 6, 12].map(|now| flash.load(BEGIN + 4, now));
            assert_eq!(loads, expected, "{acr:#x}");
        }
    }

    #[test]
    fn a_load_goes_before_a_prefetch_that_has_not_begun() {
        let mut flash = Accelerator::new(5 | PRFTEN);
        assert_eq!(flash.fetch(BEGIN, 0), 5);
        // wanted as the prefetch would begin, in cycle 6: read until 11, then line 1 until 17
        assert_eq!(flash.load(BEGIN + 0x100, 6), 5);
        assert_eq!(flash.fetch(BEGIN + LINE, 13), 4);
        // and after one that has begun: line 2 is read from 18 to 23, the data from 24 to 29
        assert_eq!(flash.load(BEGIN + 0x100, 20), 9);
    }
}
