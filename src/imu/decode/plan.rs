//! Layout compiled to the few steps in which CDR or ROS 1 bytes are walked: fields at fixed offsets form one span, and
//! only strings and lists interrupt it.

use serde::{Deserialize, Serialize};

use crate::imu::schema::layout::{Count, Evolution, Field, Hop, Kind, Layout, Number, Place};
use crate::imu::schema::lookup::PathError;
use crate::imu::schema::path::{Element, Stride};

/// Steps through a message, and the numbers to read on the way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Plan {
    pub(super) steps: Vec<Step>,
    /// Numbers to read, grouped by the step that reads them.
    pub(super) gets: Vec<Get>,
    /// Alignment of the length of a string or sequence, in bytes.
    pub(super) word: usize,
    /// Whether a `wstring` is on the way.
    pub(super) wide: bool,
}

/// A section of a message.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Step {
    /// `len` bytes from the next multiple of `align`.
    Span { align: usize, len: usize, gets: Gets },
    /// A string.
    Text { wanted: bool },
    /// A `wstring`.
    WideText,
    /// A message after its size.
    Delimited { body: Vec<Step> },
    /// A sequence of numbers.
    Numbers { size: usize, align: usize, least: usize, gets: Gets },
    /// A fixed number of elements, each walked by `body`.
    Array { count: u32, body: Vec<Step> },
    /// A sequence: `head` walks its first `least` elements, `body` each of the others.
    Sequence { least: u32, head: Vec<Step>, body: Vec<Step> },
    /// A list whose elements are all read: `count` of them, or as many as it says. After each, the numbers of those slots
    /// go into their columns that are wanted of it.
    Every { count: Option<u32>, body: Vec<Step>, slots: Vec<(usize, Stride)> },
}

/// A range of [`Plan::gets`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Gets {
    pub(super) from: usize,
    pub(super) to: usize,
}

/// A number to be read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Get {
    /// Offset in bytes from the start of the span, or of the sequence's elements.
    pub(super) at: usize,
    pub(super) number: Number,
    pub(super) slot: usize,
}

/// Rules of alignment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rules {
    /// Greatest alignment: 8 in XCDR1, 4 in XCDR2, 1 in ROS 1.
    pub(super) align: usize,
    pub(super) sizes: Sizes,
}

/// Kinds of parts that are preceded by their size in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sizes {
    /// None: XCDR1, ROS 1.
    None,
    /// Lists of anything but numbers, and messages marked as appendable: plain XCDR2.
    Lists,
    /// These, and the message itself: delimited XCDR2.
    Messages,
}

/// Most fields of a message after unrolling; real messages have fewer.
const MAX_FIELDS: usize = 16_384;

impl Plan {
    /// Compiles the steps that walk a whole message, put the numbers into slots by their order, and pick up the text.
    ///
    /// # Errors
    /// If the message has too many fields.
    pub(super) fn new(
        layout: &Layout,
        numbers: &[Place],
        text: Option<&Place>,
        rules: Rules,
    ) -> Result<Self, PathError> {
        let goals = numbers.iter().enumerate().map(|(slot, place)| (Some(slot), place));
        let goals: Vec<_> = goals.chain(text.map(|place| (None, place))).collect();
        let wanted: Vec<_> = goals.iter().map(|&(slot, place)| WantedNumber { hops: &place.hops, slot }).collect();
        let plan = Self { word: rules.align.min(4), ..Self::default() };
        let mut compiler = PlanCompiler { layout, rules, plan, phase: Phase::START, left: MAX_FIELDS };
        match compiler.message(0, &wanted, rules.sizes == Sizes::Messages) {
            Ok(()) => Ok(compiler.plan),
            Err(TooLarge) => Err(PathError::TooLarge { message: layout.name().to_owned(), most: MAX_FIELDS }),
        }
    }
}

impl Plan {
    /// Number type of a slot.
    pub(super) fn number(&self, slot: usize) -> Option<Number> {
        self.gets.iter().find(|get| get.slot == slot).map(|get| get.number)
    }
}

/// Goal below a message: a number for a slot, or the text.
#[derive(Clone, Copy)]
struct WantedNumber<'a> {
    hops: &'a [Hop],
    slot: Option<usize>,
}

/// After unrolling there are too many fields.
struct TooLarge;

/// Knowledge of the position while compiling: `position % modulus == rest`.
#[derive(Clone, Copy)]
struct Phase {
    modulus: usize,
    rest: usize,
}

impl Phase {
    const START: Self = Self::multiple_of(8);

    const fn multiple_of(modulus: usize) -> Self {
        Self { modulus, rest: 0 }
    }
}

struct PlanCompiler<'a> {
    layout: &'a Layout,
    rules: Rules,
    plan: Plan,
    phase: Phase,
    left: usize,
}

impl PlanCompiler<'_> {
    fn message(&mut self, id: usize, wanted: &[WantedNumber<'_>], delimited: bool) -> Result<(), TooLarge> {
        let layout = self.layout;
        let Some(message) = layout.messages.get(id) else { return Ok(()) };
        if delimited {
            let body = self.apart(self.plan.word, |inner| inner.fields(&message.fields, wanted))?;
            self.plan.steps.push(Step::Delimited { body });
            return Ok(());
        }
        self.fields(&message.fields, wanted)
    }

    fn fields(&mut self, fields: &[Field], wanted: &[WantedNumber<'_>]) -> Result<(), TooLarge> {
        for (i, field) in fields.iter().enumerate() {
            let inside = |w: &&WantedNumber<'_>| w.hops.first().is_some_and(|hop| hop.field == i);
            let inside: Vec<_> = wanted.iter().filter(inside).copied().collect();
            self.field(field, &inside)?;
        }
        Ok(())
    }

    fn field(&mut self, field: &Field, wanted: &[WantedNumber<'_>]) -> Result<(), TooLarge> {
        self.left = self.left.checked_sub(1).ok_or(TooLarge)?;
        let is_list = field.count != Count::One;
        if is_list && self.rules.sizes != Sizes::None && !matches!(field.kind, Kind::Number(_)) {
            self.span(4, 4);
        }
        let every = each(wanted);
        match (field.kind, field.count) {
            (kind, Count::One) => self.one(kind, &element(wanted, None))?,
            (kind, count) if !every.is_empty() => {
                let body = self.apart(1, |inner| inner.one(kind, &every))?;
                let strides = wanted.iter().filter_map(|w| Some((w.slot?, stride(w)?)));
                let slots = strides.collect();
                let count = if let Count::Array(n) = count { Some(n) } else { None };
                self.plan.steps.push(Step::Every { count, body, slots });
            }
            (Kind::Number(number), Count::Array(n)) => self.array(number, n as usize, wanted),
            (Kind::Number(number), Count::Sequence) => self.numbers(number, wanted),
            (kind, Count::Array(n)) => {
                self.elements(kind, wanted)?;
                let body = self.apart(1, |inner| inner.one(kind, &[]))?;
                let count = n.saturating_sub(least(wanted));
                if count > 0 && !body.is_empty() {
                    self.plan.steps.push(Step::Array { count, body });
                }
            }
            (kind, Count::Sequence) => {
                let head = self.apart(self.plan.word, |inner| inner.elements(kind, wanted))?;
                let body = self.apart(1, |inner| inner.one(kind, &[]))?;
                self.plan.steps.push(Step::Sequence { least: least(wanted), head, body });
            }
        }
        Ok(())
    }

    fn one(&mut self, kind: Kind, wanted: &[WantedNumber<'_>]) -> Result<(), TooLarge> {
        match kind {
            Kind::Number(number) => {
                let at = self.span(number.size(), number.size());
                for slot in wanted.iter().filter_map(|w| w.slot) {
                    self.get(Get { at, number, slot });
                }
            }
            Kind::Text => {
                self.plan.steps.push(Step::Text { wanted: !wanted.is_empty() });
                self.phase = Phase::multiple_of(1);
            }
            Kind::WideText => {
                self.plan.steps.push(Step::WideText);
                self.plan.wide = true;
                self.phase = Phase::multiple_of(1);
            }
            Kind::Message(id) => {
                let evolution = self.layout.messages.get(id).map(|message| message.evolution).unwrap_or_default();
                let delimited = match (self.rules.sizes, evolution) {
                    (Sizes::None, _) | (_, Evolution::Final) => false,
                    (_, Evolution::Appendable) => true,
                    (sizes, Evolution::Unsaid) => match self.layout.messages.first().map(|root| root.evolution) {
                        // If the root does not say either, the encapsulation shows the writer's default.
                        None | Some(Evolution::Unsaid) => sizes == Sizes::Messages,
                        // DDS-XTypes 1.3, 7.3.1.2.1.8.
                        Some(_) => true,
                    },
                };
                self.message(id, wanted, delimited)?;
            }
            // Does not occur in layouts of these encodings.
            Kind::Unread(_) => {}
        }
        Ok(())
    }

    /// Compiles the first elements of a list, up to the last wanted one.
    fn elements(&mut self, kind: Kind, wanted: &[WantedNumber<'_>]) -> Result<(), TooLarge> {
        for i in 0..least(wanted) {
            self.left = self.left.checked_sub(1).ok_or(TooLarge)?;
            self.one(kind, &element(wanted, Some(Element::At(i))))?;
        }
        Ok(())
    }

    fn array(&mut self, number: Number, n: usize, wanted: &[WantedNumber<'_>]) {
        if n == 0 {
            return;
        }
        let start = self.span(number.size(), n * number.size());
        for (element, slot) in numbered(wanted) {
            self.get(Get { at: start + element * number.size(), number, slot });
        }
    }

    fn numbers(&mut self, number: Number, wanted: &[WantedNumber<'_>]) {
        let size = number.size();
        let align = size.min(self.rules.align);
        self.plan.steps.push(Step::Numbers { size, align, least: least(wanted) as usize, gets: Gets::default() });
        for (element, slot) in numbered(wanted) {
            self.get(Get { at: element * size, number, slot });
        }
        // If the sequence is empty, only its length is aligned.
        self.phase = Phase::multiple_of(align.min(4));
    }

    /// Extends the last span, or begins one, by `len` bytes. Returns their offset in the span.
    fn span(&mut self, align: usize, len: usize) -> usize {
        let align = align.min(self.rules.align);
        let known = self.phase.modulus.is_multiple_of(align);
        if !known {
            self.phase = Phase::multiple_of(align);
        }
        let pad = (align - self.phase.rest % align) % align;
        self.phase.rest = (self.phase.rest + pad + len) % self.phase.modulus;
        match self.plan.steps.last_mut() {
            Some(Step::Span { len: so_far, .. }) if known => {
                let at = *so_far + pad;
                *so_far = at + len;
                at
            }
            _ => {
                let align = if known { 1 } else { align };
                self.plan.steps.push(Step::Span { align, len: pad + len, gets: Gets::default() });
                pad
            }
        }
    }

    /// Adds a number to those that the last step reads.
    fn get(&mut self, get: Get) {
        let from = self.plan.gets.len();
        self.plan.gets.push(get);
        if let Some(Step::Span { gets, .. } | Step::Numbers { gets, .. }) = self.plan.steps.last_mut() {
            let first = if gets.from == gets.to { from } else { gets.from };
            *gets = Gets { from: first, to: from + 1 };
        }
    }

    /// Compiles steps separately from the others, starting at a multiple of `modulus`.
    fn apart(
        &mut self,
        modulus: usize,
        compile: impl FnOnce(&mut Self) -> Result<(), TooLarge>,
    ) -> Result<Vec<Step>, TooLarge> {
        let outer = std::mem::take(&mut self.plan.steps);
        self.phase = Phase::multiple_of(modulus);
        compile(self)?;
        self.phase = Phase::multiple_of(1);
        Ok(std::mem::replace(&mut self.plan.steps, outer))
    }
}

/// Goals in one element of a list, or in a field that is not a list.
fn element<'a>(wanted: &[WantedNumber<'a>], element: Option<Element>) -> Vec<WantedNumber<'a>> {
    let of = |w: &WantedNumber<'a>| {
        let (first, hops) = w.hops.split_first()?;
        (first.element == element).then_some(WantedNumber { hops, slot: w.slot })
    };
    wanted.iter().filter_map(of).collect()
}

/// Goals in several elements of a list.
fn each<'a>(wanted: &[WantedNumber<'a>]) -> Vec<WantedNumber<'a>> {
    let inside = |w: &WantedNumber<'a>| Some(WantedNumber { hops: w.hops.get(1..)?, slot: w.slot });
    wanted.iter().filter(|w| stride(w).is_some()).filter_map(inside).collect()
}

/// Elements of the first list, if there are several.
fn stride(wanted: &WantedNumber<'_>) -> Option<Stride> {
    match wanted.hops.first()?.element? {
        Element::Each(stride) => Some(stride),
        Element::At(_) => None,
    }
}

/// Least number of elements that a list must have.
fn least(wanted: &[WantedNumber<'_>]) -> u32 {
    let last = wanted.iter().filter_map(|w| index(w)).max();
    last.map_or(0, |last| last + 1)
}

/// Index of the element of the first list.
fn index(wanted: &WantedNumber<'_>) -> Option<u32> {
    match wanted.hops.first()?.element? {
        Element::At(index) => Some(index),
        Element::Each(_) => None,
    }
}

/// Wanted elements of a list of numbers, with their slots.
fn numbered(wanted: &[WantedNumber<'_>]) -> impl Iterator<Item = (usize, usize)> {
    wanted.iter().filter_map(|w| Some((index(w)? as usize, w.slot?)))
}
