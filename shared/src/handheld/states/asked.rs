//! Requests of the host to the person who holds the probe: a slide, the finger in the air, or a weight on it. The pages
//! are those of the person's own use; the measurement belongs to the host.

use super::{Answer, Handheld, Page, RequestedSlide};
use crate::features::Slide;
use crate::handheld::guidance::{Phase, View};
use crate::handheld::judge::Judgement;
use crate::handheld::screen::Trouble;
use crate::handheld::touch::Taken;
use crate::rig::{self, Fault};
use crate::table::Name;
use crate::wire::Prompt;

impl<'p> Handheld<'p> {
    fn ask(&mut self, asked: RequestedSlide, page: Page) {
        self.clear_episode();
        self.job = None;
        self.answer = None;
        self.asked = Some(asked);
        self.idle = 0;
        self.show(page);
    }

    pub(crate) fn ask_for_slide(&mut self, asked: RequestedSlide) {
        self.ask(asked, Page::Touching);
    }

    /// Asks the person to hold the finger in the air; P_DC's zero is taken anew.
    pub(crate) fn ask_for_air(&mut self) {
        self.ask(RequestedSlide::default(), Page::Air);
        self.touch.restart();
    }

    pub(crate) fn ask_to_lift(&mut self) {
        self.ask(RequestedSlide::default(), Page::Lift);
    }

    pub(crate) fn ask_for_weight(&mut self, mn: u16) {
        self.ask(RequestedSlide::default(), Page::Weigh(mn));
    }

    /// Asks the person to point the finger straight down, and then to turn it `over`.
    pub(crate) fn ask_to_turn(&mut self, over: bool) {
        self.ask(RequestedSlide::default(), Page::Turn(over));
        if over {
            self.sound(super::GOOD);
        }
    }

    /// Takes the result of the last request; `None` the second time.
    pub fn answer(&mut self) -> Option<Answer> {
        self.answer.take()
    }

    /// Ends the host's request and leaves the page for its slides.
    pub fn release(&mut self) {
        let wanted = self.asked.take().is_some();
        self.answer = None;
        if wanted || matches!(self.page, Page::Lift | Page::Air | Page::Weigh(_)) {
            self.begin();
        }
    }

    /// Ends a fault, if it is over.
    pub fn clear(&mut self) {
        self.asked = None;
        self.begin();
    }

    /// Takes the verdict of the host's slides: shown as after the person's own, and it can be taught. `compared`: the
    /// question was whether it is the first one.
    pub fn told(&mut self, judgement: Judgement, compared: bool) {
        self.clear_episode();
        let first = judgement.leading.first().filter(|_| compared);
        self.reference = first.map(|(texture, _)| *texture);
        self.show_verdict(judgement);
    }

    /// The host's slides trained this texture.
    pub fn trained(&mut self, name: Name) {
        self.sound(super::SURE_IT_IS);
        self.show(Page::Learned(Ok(name)));
    }

    /// Another table is in force, with so many textures: leaves the pages of the old one.
    pub(crate) fn table_changed(&mut self, textures: u16) {
        self.textures = textures;
        if matches!(
            self.page,
            Page::Ready
                | Page::Touching
                | Page::Again(_)
                | Page::Verdict
                | Page::Choose(..)
                | Page::Spell(_)
        ) {
            self.begin();
        }
    }

    /// Sets the contact force of a count of P_DC, mN.
    pub fn calibrate(&mut self, mn_per_count: f32) {
        self.touch.calibrate(mn_per_count);
    }

    /// The person's task for the host now; `None`: nothing.
    pub fn prompt(&self) -> Option<Prompt> {
        self.asked?;
        Some(match (&self.page, self.touch.view().phase) {
            (Page::Again(why), _) => Prompt::Again(*why),
            (Page::Weigh(mn), _) if self.touch.has_zero() => Prompt::Weigh(*mn),
            (Page::Turn(false), _) => Prompt::Still,
            (Page::Turn(true), _) => Prompt::TurnOver,
            (Page::Touching, Phase::Slide | Phase::Sliding) => Prompt::Slide,
            (Page::Touching, Phase::Air | Phase::Press) if self.touch.has_zero() => Prompt::Press,
            _ => Prompt::Lift,
        })
    }

    /// The slide that was good last, until the finger is pressed again.
    pub fn slide(&self) -> &Slide<'p> {
        self.touch.slide()
    }

    /// The samples that came with the last word.
    pub fn taken(&self) -> &Taken {
        self.touch.taken()
    }

    /// P_DC in the air, counts; `None` before it is known.
    pub fn air_counts(&self) -> Option<f32> {
        self.touch.air_counts()
    }

    /// Mean P_DC of the last 100 ms, counts above that in the air.
    pub(crate) fn counts_above_air(&self) -> Option<f32> {
        self.touch.counts_above_air()
    }

    /// The touch as it is shown.
    pub fn view(&self) -> View {
        self.touch.view()
    }

    /// The fault that keeps the probe from sliding.
    pub fn fault(&self) -> Option<Fault> {
        match &self.page {
            Page::Fault(Trouble::Silent) => Some(Fault::SensorSilent),
            Page::Fault(Trouble::Frozen) => Some(Fault::SensorFrozen),
            _ => None,
        }
    }

    /// The phase of a rig in this state.
    pub fn phase(&self) -> rig::Phase {
        if let Some(fault) = self.fault() {
            return rig::Phase::Faulted(fault);
        }
        match self.touch.view().phase {
            _ if !self.listens() => rig::Phase::Ready,
            Phase::Air => rig::Phase::Ready,
            Phase::Press => rig::Phase::Pressing,
            Phase::Slide => rig::Phase::Background,
            Phase::Sliding => rig::Phase::Sliding,
            Phase::Lift => rig::Phase::Lifting,
        }
    }
}
