//! Wanted fields of a protobuf message, compiled once per channel from its [`Layout`].

use serde::{Deserialize, Serialize};

use crate::imu::schema::layout::{Coding, Count, Field, Hop, Kind, Layout, Number, Place, Tag};
use crate::imu::schema::lookup::PathError;
use crate::imu::schema::path::{Element, Stride};

/// Plan of a message from which something is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::imu::decode) struct ProtobufPlan {
    /// Index among the messages from which something is read.
    pub(super) id: usize,
    pub(super) fields: Vec<PlannedField>,
    /// Slots and their defaults, used if the message is present without the field.
    pub(super) absent: Vec<(usize, Bits)>,
}

/// A number stored by its bits, since it may be NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Bits(pub(super) u64);

/// A field that is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PlannedField {
    pub(super) number: u32,
    pub(super) take: Take,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Take {
    Number {
        number: Number,
        coding: Coding,
        slots: Vec<usize>,
    },
    Text,
    Message(ProtobufPlan),
    /// A list of numbers: elements and their slots.
    Numbers {
        list: usize,
        number: Number,
        coding: Coding,
        slots: Vec<(u32, usize)>,
        /// Slots of several elements.
        every: Vec<(usize, Stride)>,
    },
    /// A list of messages: the elements from which something is read.
    Messages {
        list: usize,
        elements: Vec<(u32, ProtobufPlan)>,
        every: Option<Box<EveryElement>>,
    },
}

/// Plan for every element of a list of messages.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct EveryElement {
    pub(super) plan: ProtobufPlan,
    pub(super) slots: Vec<(usize, Stride)>,
    /// One bit for each [`ProtobufPlan::id`] in it, and its lists, which each element begins anew.
    pub(super) ids: u32,
    pub(super) lists: Vec<usize>,
}

/// Largest number of messages, and of lists, from which something is read; real configurations have fewer.
pub(super) const MAX_PARTS: usize = 32;

impl ProtobufPlan {
    /// Compiles the plan that reads the numbers into slots by their order, and the text.
    ///
    /// # Errors
    /// If more parts are read than any real message has.
    pub(in crate::imu::decode) fn new(
        layout: &Layout,
        numbers: &[Place],
        text: Option<&Place>,
    ) -> Result<Self, PathError> {
        let mut compiler = ProtobufCompiler { layout, messages: 0, lists: 0 };
        let mut root = compiler.protobuf();
        for (slot, place) in numbers.iter().enumerate() {
            compiler.want(&mut root, 0, &place.hops, Some(slot));
        }
        if let Some(place) = text {
            compiler.want(&mut root, 0, &place.hops, None);
        }
        match compiler.messages.max(compiler.lists) {
            0..=MAX_PARTS => {
                root.seal();
                Ok(root)
            }
            _ => Err(PathError::TooLarge { message: layout.name().to_owned(), most: MAX_PARTS }),
        }
    }

    /// Field numbers on the path to a number of fixed size, its own last, and its type. Empty if a list is on the path,
    /// since lists omit no element; [`grown`](Self::grown) adds what is missing inside one.
    pub(in crate::imu::decode) fn way(&self, slot: usize) -> Option<(Vec<u32>, Number)> {
        self.fields.iter().find_map(|wanted| match &wanted.take {
            Take::Number { number, coding: Coding::Fixed, slots } if slots.contains(&slot) => {
                Some((vec![wanted.number], *number))
            }
            Take::Numbers { number, coding: Coding::Fixed, slots, every, .. }
                if slots.iter().any(|&(_, own)| own == slot) || every.iter().any(|&(own, _)| own == slot) =>
            {
                Some((Vec::new(), *number))
            }
            Take::Message(inner) => {
                let (mut way, number) = inner.way(slot)?;
                if !way.is_empty() {
                    way.insert(0, wanted.number);
                }
                Some((way, number))
            }
            Take::Messages { elements, every, .. } => {
                let plans = elements.iter().map(|(_, inner)| inner).chain(every.iter().map(|every| &every.plan));
                plans.into_iter().find_map(|inner| inner.way(slot)).map(|(_, number)| (Vec::new(), number))
            }
            _ => None,
        })
    }

    /// Notes what each element begins anew.
    fn seal(&mut self) {
        for field in &mut self.fields {
            match &mut field.take {
                Take::Message(inner) => inner.seal(),
                Take::Messages { every: Some(every), .. } => {
                    let EveryElement { plan, ids, lists, .. } = &mut **every;
                    plan.count_in(ids, lists);
                }
                _ => {}
            }
        }
    }

    /// Adds its parts.
    fn count_in(&self, ids: &mut u32, lists: &mut Vec<usize>) {
        *ids |= 1 << self.id;
        for field in &self.fields {
            match &field.take {
                Take::Message(inner) => inner.count_in(ids, lists),
                Take::Numbers { list, .. } => lists.push(*list),
                Take::Messages { list, elements, .. } => {
                    lists.push(*list);
                    elements.iter().for_each(|(_, inner)| inner.count_in(ids, lists));
                }
                Take::Number { .. } | Take::Text => {}
            }
        }
    }
}

struct ProtobufCompiler<'a> {
    layout: &'a Layout,
    messages: usize,
    lists: usize,
}

impl ProtobufCompiler<'_> {
    fn protobuf(&mut self) -> ProtobufPlan {
        self.messages += 1;
        ProtobufPlan { id: self.messages - 1, fields: Vec::new(), absent: Vec::new() }
    }

    /// Adds the target of `hops` from `message`, whose plan is `own`.
    fn want(&mut self, own: &mut ProtobufPlan, message: usize, hops: &[Hop], slot: Option<usize>) {
        let Some((hop, rest)) = hops.split_first() else { return };
        let field = self.layout.messages.get(message).and_then(|message| message.fields.get(hop.field));
        let Some(&Field { kind, count, tag: Some(tag), .. }) = field else { return };
        let at = own.fields.iter().position(|wanted| wanted.number == tag.number).unwrap_or(own.fields.len());
        if at == own.fields.len() {
            let take = self.take(kind, count, tag);
            own.fields.push(PlannedField { number: tag.number, take });
        }
        let inner = match (&mut own.fields[at].take, hop.element, slot) {
            (Take::Number { slots, .. }, _, Some(slot)) => {
                slots.push(slot);
                own.absent.push((slot, Bits(tag.absent.to_bits())));
                return;
            }
            (Take::Numbers { slots, .. }, Some(Element::At(element)), Some(slot)) => {
                return slots.push((element, slot));
            }
            (Take::Numbers { every, .. }, Some(Element::Each(stride)), Some(slot)) => {
                return every.push((slot, stride));
            }
            (Take::Message(inner), ..) => inner,
            (Take::Messages { every, .. }, Some(Element::Each(stride)), Some(slot)) => {
                let every = every.get_or_insert_with(|| {
                    let plan = self.protobuf();
                    Box::new(EveryElement { plan, slots: Vec::new(), ids: 0, lists: Vec::new() })
                });
                every.slots.push((slot, stride));
                &mut every.plan
            }
            (Take::Messages { elements, .. }, Some(Element::At(element)), _) => {
                let at = elements.iter().position(|(known, _)| *known == element).unwrap_or(elements.len());
                if at == elements.len() {
                    elements.push((element, self.protobuf()));
                }
                &mut elements[at].1
            }
            _ => return,
        };
        if let Kind::Message(id) = kind {
            self.want(inner, id, rest, slot);
        }
    }

    fn take(&mut self, kind: Kind, count: Count, Tag { coding, .. }: Tag) -> Take {
        let list = self.lists;
        self.lists += usize::from(count != Count::One);
        match (kind, count) {
            (Kind::Number(number), Count::One) => Take::Number { number, coding, slots: Vec::new() },
            (Kind::Number(number), _) => Take::Numbers { list, number, coding, slots: Vec::new(), every: Vec::new() },
            (Kind::Message(_), Count::One) => Take::Message(self.protobuf()),
            (Kind::Message(_), _) => Take::Messages { list, elements: Vec::new(), every: None },
            _ => Take::Text,
        }
    }
}
