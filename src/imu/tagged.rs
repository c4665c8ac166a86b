//! Protobuf messages walked on the wire, without building values and without allocation. What is looked for is compiled
//! once per channel from its [`Layout`]; the walk itself is left to [`walk`].
//!
//! As parsers must (<https://protobuf.dev/programming-guides/encoding/>): of a field that comes twice, the last number
//! counts and messages are merged; lists may be packed or not, whatever the schema says; what is unknown is skipped.

mod walk;

use serde::{Deserialize, Serialize};

use self::walk::{Walk, wire};
use super::layout::{Coding, Count, Field, Hop, Kind, Layout, Number, Place, Tag};
use super::lookup::PathError;
use super::walk::Malformed;

/// A message that something is read from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Tagged {
    /// Its own number among those that are read from.
    id: usize,
    fields: Vec<Wanted>,
    /// Slots, and what is in them where the message is there but leaves the field out.
    absent: Vec<(usize, Bits)>,
}

/// A number saved by its bits, for it may be NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Bits(u64);

/// A field that is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Wanted {
    number: u32,
    take: Take,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Take {
    Number {
        number: Number,
        coding: Coding,
        slots: Vec<usize>,
    },
    Text,
    Message(Tagged),
    /// A list of numbers: which elements go to which slots.
    Numbers {
        list: usize,
        number: Number,
        coding: Coding,
        slots: Vec<(u32, usize)>,
    },
    /// A list of messages: which elements are read from.
    Messages {
        list: usize,
        elements: Vec<(u32, Tagged)>,
    },
}

/// Messages, and lists, from which something is read; more are in no real configuration.
const MAX_PARTS: usize = 32;

impl Tagged {
    /// Reads the numbers into slots by their order, and the text.
    ///
    /// # Errors
    /// If more parts are read from than any real message has.
    pub(super) fn new(layout: &Layout, numbers: &[Place], text: Option<&Place>) -> Result<Self, PathError> {
        let mut compiler = Compiler { layout, messages: 0, lists: 0 };
        let mut root = compiler.tagged();
        for (slot, place) in numbers.iter().enumerate() {
            compiler.want(&mut root, 0, &place.hops, Some(slot));
        }
        if let Some(place) = text {
            compiler.want(&mut root, 0, &place.hops, None);
        }
        match compiler.messages.max(compiler.lists) {
            0..=MAX_PARTS => Ok(root),
            _ => Err(PathError::TooLarge { message: layout.name().to_owned(), most: MAX_PARTS }),
        }
    }

    /// Walks a message; the text found. A number that is not there is what its field's default says, and NaN if the
    /// message or list around it is not there either.
    pub(super) fn read<'d>(&self, data: &'d [u8], numbers: &mut [f64]) -> Result<&'d [u8], Malformed> {
        self.walk::<false>(data, numbers)
    }

    /// Finds where numbers of fixed size begin; NaN for every other, and for one that is not there.
    pub(super) fn locate(&self, data: &[u8], places: &mut [f64]) -> Result<(), Malformed> {
        self.walk::<true>(data, places).map(drop)
    }

    fn walk<'d, const LOCATE: bool>(&self, data: &'d [u8], numbers: &mut [f64]) -> Result<&'d [u8], Malformed> {
        numbers.fill(f64::NAN);
        let mut walk = Walk::<LOCATE> { data, at: 0, numbers, text: &[], begun: 0, counts: [0; MAX_PARTS] };
        walk.message(self, data.len())?;
        Ok(walk.text)
    }

    /// The fields that lead to a number of fixed size, itself the last, and how it is written. No lists are on the way
    /// unless the number itself is in one, which leaves no element out.
    pub(super) fn way(&self, slot: usize) -> Option<(Vec<u32>, Number)> {
        self.fields.iter().find_map(|wanted| match &wanted.take {
            Take::Number { number, coding: Coding::Fixed, slots } if slots.contains(&slot) => {
                Some((vec![wanted.number], *number))
            }
            Take::Numbers { number, coding: Coding::Fixed, slots, .. } if slots.iter().any(|&(_, own)| own == slot) => {
                Some((Vec::new(), *number))
            }
            Take::Message(inner) => {
                let (mut way, number) = inner.way(slot)?;
                if !way.is_empty() {
                    way.insert(0, wanted.number);
                }
                Some((way, number))
            }
            Take::Messages { elements, .. } => {
                elements.iter().find_map(|(_, inner)| inner.way(slot)).map(|(_, number)| (Vec::new(), number))
            }
            _ => None,
        })
    }
}

/// A message that holds one number at the end of a way, to be merged into another: all that follows counts.
pub(super) fn alone(way: &[u32], bytes: &[u8]) -> Vec<u8> {
    let Some((&number, outer)) = way.split_last() else { return Vec::new() };
    let mut out = Vec::new();
    varint(&mut out, u64::from(number) << 3 | if bytes.len() == 8 { wire::I64 } else { wire::I32 });
    out.extend_from_slice(bytes);
    for &number in outer.iter().rev() {
        let mut around = Vec::new();
        varint(&mut around, u64::from(number) << 3 | wire::LEN);
        varint(&mut around, out.len() as u64);
        around.extend(out);
        out = around;
    }
    out
}

fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

struct Compiler<'a> {
    layout: &'a Layout,
    messages: usize,
    lists: usize,
}

impl Compiler<'_> {
    fn tagged(&mut self) -> Tagged {
        self.messages += 1;
        Tagged { id: self.messages - 1, fields: Vec::new(), absent: Vec::new() }
    }

    /// Wants what `hops` lead to from `message`, which `own` reads.
    fn want(&mut self, own: &mut Tagged, message: usize, hops: &[Hop], slot: Option<usize>) {
        let Some((hop, rest)) = hops.split_first() else { return };
        let field = self.layout.messages.get(message).and_then(|message| message.fields.get(hop.field));
        let Some(&Field { kind, count, tag: Some(tag), .. }) = field else { return };
        let at = own.fields.iter().position(|wanted| wanted.number == tag.number).unwrap_or(own.fields.len());
        if at == own.fields.len() {
            let take = self.take(kind, count, tag);
            own.fields.push(Wanted { number: tag.number, take });
        }
        let inner = match (&mut own.fields[at].take, hop.element, slot) {
            (Take::Number { slots, .. }, _, Some(slot)) => {
                slots.push(slot);
                own.absent.push((slot, Bits(tag.absent.to_bits())));
                return;
            }
            (Take::Numbers { slots, .. }, Some(element), Some(slot)) => return slots.push((element, slot)),
            (Take::Message(inner), ..) => inner,
            (Take::Messages { elements, .. }, Some(element), _) => {
                let at = elements.iter().position(|(known, _)| *known == element).unwrap_or(elements.len());
                if at == elements.len() {
                    elements.push((element, self.tagged()));
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
            (Kind::Number(number), _) => Take::Numbers { list, number, coding, slots: Vec::new() },
            (Kind::Message(_), Count::One) => Take::Message(self.tagged()),
            (Kind::Message(_), _) => Take::Messages { list, elements: Vec::new() },
            _ => Take::Text,
        }
    }
}
