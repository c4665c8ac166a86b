//! Extraction of numbers and a text from JSON messages in one pass, without building values.
//! [`Decoder`](super::Decoder) determines what is extracted.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;

use serde::de::{self, DeserializeSeed, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use super::lists::Lists;
use super::malformed::Malformed;
use crate::imu::schema::layout::Place;
use crate::imu::schema::path::{Element, Stride};

/// Values to pick from a JSON value and from its contents.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Pick {
    slots: Vec<usize>,
    text: bool,
    fields: Vec<(String, Pick)>,
    elements: Vec<(u32, Pick)>,
    every: Option<Box<ListPick>>,
}

/// Values to pick from each element of a list.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct ListPick {
    pick: Pick,
    /// Their slots, and the elements that they are wanted of.
    slots: Vec<(usize, Stride)>,
}

impl Pick {
    /// Picks the numbers into slots by their order, and the text.
    pub(super) fn new(numbers: &[Place], text: Option<&Place>) -> Self {
        let mut root = Self::default();
        for (slot, place) in numbers.iter().enumerate() {
            root.at(place, slot).slots.push(slot);
        }
        if let Some(place) = text {
            // A text is never in every element.
            root.at(place, usize::MAX).text = true;
        }
        root
    }

    fn at(&mut self, place: &Place, slot: usize) -> &mut Self {
        place.path.segments().iter().fold(self, |pick, segment| {
            let field = match segment.name.is_empty() {
                true => pick,
                false => child(&mut pick.fields, segment.name.clone()),
            };
            match segment.element {
                Some(Element::At(element)) => child(&mut field.elements, element),
                Some(Element::Each(stride)) => {
                    let every = field.every.get_or_insert_default();
                    every.slots.push((slot, stride));
                    &mut every.pick
                }
                None => field,
            }
        })
    }

    /// Decodes a message. A number that is missing or of another type is NaN.
    pub(super) fn read<'d>(
        &self,
        data: &'d [u8],
        numbers: &mut [f64],
        lists: &mut Lists,
    ) -> Result<Cow<'d, [u8]>, Malformed> {
        numbers.fill(f64::NAN);
        let mut found = Picked { numbers, lists, text: Cow::Borrowed(&[]) };
        let mut json = serde_json::Deserializer::from_slice(data);
        let read = Picking { pick: self, found: &mut found }.deserialize(&mut json).and_then(|()| json.end());
        read.map_err(|e| Malformed::Json { line: e.line(), column: e.column() })?;
        Ok(found.text)
    }
}

/// Byte ranges of the texts of numbers.
#[derive(Debug, Default)]
pub(super) struct Places {
    /// By slot; `None` for a number that is missing or none.
    pub(super) numbers: Vec<Option<Range<usize>>>,
    /// By slot and element of its list.
    pub(super) lists: Vec<Vec<Option<Range<usize>>>>,
}

impl Pick {
    /// Finds the byte ranges of the texts of so many numbers.
    pub(super) fn locate(&self, data: &[u8], count: usize) -> Option<Places> {
        let root: &RawValue = serde_json::from_slice(data).ok()?;
        let mut places = Places { numbers: vec![None; count], lists: vec![Vec::new(); count] };
        self.locate_in(root, data.as_ptr().addr(), &mut places);
        Some(places)
    }

    fn locate_in(&self, value: &RawValue, origin: usize, places: &mut Places) {
        let text = value.get();
        // The text of a raw value is a slice of the message.
        let start = text.as_ptr().addr().wrapping_sub(origin);
        for &slot in
            self.slots.iter().filter(|_| text.starts_with(|first: char| first == '-' || first.is_ascii_digit()))
        {
            if let Some(place) = places.numbers.get_mut(slot) {
                *place = Some(start..start + text.len());
            }
        }
        if !self.fields.is_empty()
            && let Ok(fields) = serde_json::from_str::<BTreeMap<Cow<'_, str>, &RawValue>>(text)
        {
            for (name, pick) in &self.fields {
                fields.get(name.as_str()).into_iter().for_each(|value| pick.locate_in(value, origin, places));
            }
        }
        if self.elements.is_empty() && self.every.is_none() {
            return;
        }
        let Ok(elements) = serde_json::from_str::<Vec<&RawValue>>(text) else { return };
        for &(element, ref pick) in &self.elements {
            elements.get(element as usize).into_iter().for_each(|value| pick.locate_in(value, origin, places));
        }
        let Some(ListPick { pick, slots }) = self.every.as_deref() else { return };
        for (i, value) in (0_u32..).zip(elements) {
            pick.locate_in(value, origin, places);
            for &(slot, stride) in slots {
                let found = places.numbers.get_mut(slot).and_then(Option::take);
                if let Some(list) = places.lists.get_mut(slot).filter(|_| stride.takes(i)) {
                    list.push(found);
                }
            }
        }
    }
}

/// Pick of a field or element, created if missing.
fn child<K: PartialEq>(picks: &mut Vec<(K, Pick)>, key: K) -> &mut Pick {
    let at = picks.iter().position(|(known, _)| *known == key).unwrap_or(picks.len());
    if at == picks.len() {
        picks.push((key, Pick::default()));
    }
    &mut picks[at].1
}

struct Picked<'d, 'n> {
    numbers: &'n mut [f64],
    lists: &'n mut Lists,
    text: Cow<'d, [u8]>,
}

struct Picking<'p, 'f, 'd, 'n> {
    pick: &'p Pick,
    found: &'f mut Picked<'d, 'n>,
}

impl<'d> DeserializeSeed<'d> for Picking<'_, '_, 'd, '_> {
    type Value = ();

    fn deserialize<D: de::Deserializer<'d>>(self, json: D) -> Result<(), D::Error> {
        json.deserialize_any(self)
    }
}

impl Picking<'_, '_, '_, '_> {
    fn number<E>(self, value: f64) -> Result<(), E> {
        for &slot in &self.pick.slots {
            if let Some(number) = self.found.numbers.get_mut(slot) {
                *number = value;
            }
        }
        Ok(())
    }
}

impl<'d> Visitor<'d> for Picking<'_, '_, 'd, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any value")
    }

    fn visit_f64<E>(self, value: f64) -> Result<(), E> {
        self.number(value)
    }

    fn visit_u64<E>(self, value: u64) -> Result<(), E> {
        self.number(value as f64)
    }

    fn visit_i64<E>(self, value: i64) -> Result<(), E> {
        self.number(value as f64)
    }

    fn visit_bool<E>(self, _: bool) -> Result<(), E> {
        self.number(f64::NAN)
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        self.number(f64::NAN)
    }

    fn visit_str<E>(self, text: &str) -> Result<(), E> {
        if self.pick.text {
            self.found.text = Cow::Owned(text.as_bytes().to_vec());
        }
        self.number(f64::NAN)
    }

    fn visit_borrowed_str<E>(self, text: &'d str) -> Result<(), E> {
        if self.pick.text {
            self.found.text = Cow::Borrowed(text.as_bytes());
        }
        self.number(f64::NAN)
    }

    fn visit_map<A: MapAccess<'d>>(self, mut map: A) -> Result<(), A::Error> {
        let Self { pick, found } = self;
        while let Some(key) = map.next_key_seed(Key(&pick.fields))? {
            match key {
                Some(pick) => map.next_value_seed(Picking { pick, found })?,
                None => drop(map.next_value::<IgnoredAny>()?),
            }
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'d>>(self, mut list: A) -> Result<(), A::Error> {
        let Self { pick, found } = self;
        if let Some(ListPick { pick, slots }) = pick.every.as_deref() {
            for i in 0_u32.. {
                for &(slot, _) in slots {
                    found.numbers.get_mut(slot).into_iter().for_each(|number| *number = f64::NAN);
                }
                if list.next_element_seed(Picking { pick, found })?.is_none() {
                    return Ok(());
                }
                for &(slot, _) in slots.iter().filter(|(_, stride)| stride.takes(i)) {
                    found.lists.push(slot, found.numbers.get(slot).copied().unwrap_or(f64::NAN));
                }
            }
        }
        for i in 0_u32.. {
            let more = match pick.elements.iter().find(|(element, _)| *element == i) {
                Some((_, pick)) => list.next_element_seed(Picking { pick, found })?.is_some(),
                None => list.next_element::<IgnoredAny>()?.is_some(),
            };
            if !more {
                break;
            }
        }
        Ok(())
    }
}

/// Picks that a key selects from.
struct Key<'p>(&'p [(String, Pick)]);

impl<'p, 'd> DeserializeSeed<'d> for Key<'p> {
    type Value = Option<&'p Pick>;

    fn deserialize<D: de::Deserializer<'d>>(self, json: D) -> Result<Self::Value, D::Error> {
        json.deserialize_str(self)
    }
}

impl<'p, 'd> Visitor<'d> for Key<'p> {
    type Value = Option<&'p Pick>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E>(self, key: &str) -> Result<Self::Value, E> {
        Ok(self.0.iter().find(|(name, _)| name == key).map(|(_, pick)| pick))
    }
}
