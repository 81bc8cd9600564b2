//! Effects of time and of the button on each page: a short press moves on, a long one takes.

use super::lists::{Entry, List};
use super::{Answer, CLICK, Choice, DARK_AFTER, Handheld, Job, LEARNED, NO_WORDS, Page};
use crate::handheld::button::Press;
use crate::handheld::screen::Trouble;
use crate::handheld::spelling::{Spelling, Taken};

impl Handheld<'_> {
    /// A hundredth of a second, with the level of the button.
    pub fn tick(&mut self, pressed: bool) {
        self.shown = self.shown.saturating_add(1);
        self.idle = self.idle.saturating_add(1);
        self.play();
        if self.listens() {
            self.silent = self.silent.saturating_add(1);
            if self.silent >= NO_WORDS && !matches!(self.page, Page::Fault(_)) {
                self.fail(Trouble::Silent);
            }
        }
        if let Some(press) = self.button.tick(pressed) {
            self.idle = 0;
            self.pressed(press);
        }
        match &self.page {
            Page::Learned(_) if self.shown >= LEARNED => self.begin(),
            Page::Thinking | Page::Saving | Page::Fault(_) | Page::Dark => {}
            _ if self.idle >= DARK_AFTER && self.asked.is_some() => self.end(Answer::Nobody),
            _ if self.idle >= DARK_AFTER => self.show(Page::Dark),
            _ => {}
        }
    }

    fn pressed(&mut self, press: Press) {
        self.fresh = true;
        let asks = self
            .judgement
            .as_ref()
            .is_some_and(|judgement| judgement.changed);
        match (&mut self.page, press) {
            // no sound while the table is at work
            (Page::Thinking | Page::Saving, _) => return,
            (Page::Dark, _) => self.begin(),
            (Page::Ready, Press::Short) => self.show(Page::Choose(List::Menu, 0)),
            (Page::Ready, Press::Long) => {
                self.clear_episode();
                self.training = true;
                self.show(Page::Touching);
            }
            (_, Press::Short) if self.asked.is_some() => {}
            (_, Press::Long) if self.asked.is_some() => self.end(Answer::GivenUp),
            (Page::Touching | Page::Again(_), Press::Short) => {}
            // is it the leading one?
            (Page::Verdict, press) if asks => self.confirm(press),
            (Page::Verdict, Press::Long) => self.show(match self.reference {
                Some(reference) => Page::Choose(List::Reference, reference),
                None => Page::Choose(List::Name, 0),
            }),
            (Page::Choose(list, at), Press::Short) => {
                let (list, next) = (*list, at.saturating_add(1));
                let at = if next < self.entries(list).count() {
                    next
                } else {
                    0
                };
                self.show(Page::Choose(list, at));
            }
            (Page::Choose(list, at), Press::Long) => {
                let (list, at) = (*list, *at);
                self.take(list, at);
            }
            (Page::Spell(spelling), Press::Short) => spelling.turn(),
            (Page::Spell(spelling), Press::Long) => match spelling.take() {
                Taken::Letter => {}
                Taken::Done(name) => self.teach(Choice::Spelled(name)),
                Taken::Back => self.show(Page::Choose(List::Name, 0)),
            },
            (Page::Fault(Trouble::Silent | Trouble::Frozen), _) => {}
            _ => self.begin(),
        }
        self.sound(CLICK);
    }

    fn take(&mut self, list: List, at: u16) {
        match self.entries(list).entry(at) {
            Entry::Compare => self.show(Page::Choose(List::Reference, 0)),
            Entry::About => self.show(Page::About),
            Entry::Known(texture) if list == List::Reference => self.compare(texture),
            Entry::Known(texture) => self.teach(Choice::Known(texture)),
            Entry::Numbered => self.teach(Choice::Numbered),
            Entry::Spell => self.show(Page::Spell(Spelling::default())),
            Entry::Nothing => self.begin(),
        }
    }

    /// "Is it this one?", and the button says yes or no: it moves, or the list begins with a new one.
    fn confirm(&mut self, press: Press) {
        let first = self.entries(List::Name).leading().next();
        match (press, first) {
            (Press::Long, Some(texture)) => self.teach(Choice::Known(texture)),
            _ => {
                let new = self.entries(List::Name).leading().count();
                self.show(Page::Choose(List::Name, new as u16));
            }
        }
    }

    fn teach(&mut self, choice: Choice) {
        if self.judgement.is_none() {
            // no slide was measured
            return self.begin();
        }
        self.job = Some(Job::Teach(choice));
        self.show(Page::Saving);
    }
}
