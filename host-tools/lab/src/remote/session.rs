//! A probe at a line, asked in JSON.

use std::cell::RefCell;
use std::future::Future;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Waker};
use std::time::Duration;

use embassy_futures::yield_now;

use super::bench::{Bench, WorkError};
use super::message::{File, Frame, Reply, Request, Work};
#[cfg(feature = "open")]
use super::open::open;
#[cfg(feature = "open")]
use super::recorded::{Opened, Recorded};
use super::work;
use crate::live::sentence;

/// What waits for its turn.
type Desk = Rc<RefCell<Option<Work>>>;

/// Somebody works with a probe.
struct Open {
    bench: Bench,
    desk: Desk,
    life: Pin<Box<dyn Future<Output = ()>>>,
}

/// A probe at a line that somebody else carries.
#[derive(Default)]
pub struct Remote {
    open: Option<Open>,
    #[cfg(feature = "open")]
    given: Vec<Vec<u8>>,
    #[cfg(feature = "open")]
    recorded: Option<Recorded>,
}

type Answered = Result<Frame, Box<dyn std::error::Error>>;

impl Remote {
    /// Takes the bytes of a file, which [`Request::Open`] names then.
    #[cfg(feature = "open")]
    pub fn give(&mut self, bytes: Vec<u8>) {
        self.given.push(bytes);
    }

    /// Does what is asked for, in JSON: a [`Request`], and a [`Reply`].
    pub fn ask(&mut self, request: &str) -> String {
        let reply = match serde_json::from_str(request) {
            Ok(request) => self.answer(request).map_or_else(
                |why| Reply::Error {
                    why: sentence(why.as_ref()),
                },
                Reply::Frame,
            ),
            Err(why) => Reply::Error {
                why: format!("no request: {why}"),
            },
        };
        serde_json::to_string(&reply).unwrap_or_default()
    }

    /// Does what is asked for.
    ///
    /// # Errors
    /// It makes no sense now.
    pub fn answer(&mut self, request: Request) -> Answered {
        match request {
            Request::Connect { port, now_ms } => {
                let bench = Bench::new(&port, Duration::from_millis(now_ms))?;
                let desk = Desk::default();
                let life = Box::pin(live(bench.clone(), Rc::clone(&desk)));
                self.open = Some(Open { bench, desk, life });
                self.at_line()?.go_on()
            }
            Request::Step { now_ms, received } => {
                let open = self.at_line()?;
                open.bench.take(&received, Duration::from_millis(now_ms));
                open.go_on()
            }
            Request::Closed => {
                let open = self.at_line()?;
                open.bench.close();
                let last = open.go_on();
                self.open = None;
                last
            }
            Request::Work { work } => {
                let open = self.at_line()?;
                if !open.bench.is_connected() {
                    return Err("no probe is connected".into());
                }
                if open.bench.is_busy() {
                    return Err("the probe is busy: stop it first".into());
                }
                open.bench.busy(true);
                *open.desk.borrow_mut() = Some(work);
                open.go_on()
            }
            Request::Stop => {
                let open = self.at_line()?;
                open.bench.stop();
                open.go_on()
            }
            Request::Answer { yes } => {
                let open = self.at_line()?;
                open.bench.answer(yes);
                open.go_on()
            }
            Request::Log => {
                let bench = &self.at_line()?.bench;
                let mut frame = bench.frame();
                frame.files.push(File {
                    name: "session.jsonl".to_owned(),
                    bytes: bench.log(),
                });
                Ok(frame)
            }
            #[cfg(feature = "open")]
            Request::Open { files } => {
                let given = std::mem::take(&mut self.given);
                let files = files.into_iter().zip(given);
                let files = files.map(|(name, bytes)| File { name, bytes }).collect();
                self.recorded = None;
                Ok(match open(files)? {
                    Opened::Session(frame) => frame,
                    Opened::Recordings(recorded) => self.recorded.insert(recorded).show(),
                })
            }
            #[cfg(feature = "open")]
            Request::Recorded { at } => {
                let streams = self.recorded.as_ref().and_then(|all| all.streams(at));
                Ok(Frame {
                    streams: Some(streams.ok_or("there is no such slide")?),
                    ..Frame::default()
                })
            }
        }
    }

    fn at_line(&mut self) -> Result<&mut Open, &'static str> {
        self.open.as_mut().ok_or("no probe is connected")
    }
}

impl Open {
    fn go_on(&mut self) -> Answered {
        let mut context = Context::from_waker(Waker::noop());
        // it never ends
        let _ = self.life.as_mut().poll(&mut context);
        Ok(self.bench.frame())
    }
}

/// Works with a probe for as long as there is a line.
async fn live(bench: Bench, desk: Desk) {
    let greeted = work::status(&bench).await;
    bench.connected(greeted.is_ok());
    over(&bench, greeted);
    loop {
        // a line that is closed is told once, by whatever needs it next
        let heard = bench.listen();
        if let Err(why) = heard {
            bench.connected(false);
            over(&bench, Err(why));
            return std::future::pending().await;
        }
        let next = desk.borrow_mut().take();
        if let Some(wanted) = next {
            let done = work::work(&bench, wanted).await;
            over(&bench, done);
        }
        yield_now().await;
    }
}

fn over(bench: &Bench, done: Result<(), WorkError>) {
    if let Err(why) = done {
        bench.fails(sentence(&why));
    }
    bench.busy(false);
}
