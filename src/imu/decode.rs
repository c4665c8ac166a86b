//! Message bytes to numbers: a [`Decoder`] is compiled once per channel from its layout, and walks each message without
//! building values.

mod encoding;
mod json;
pub(super) mod lists;
pub(super) mod malformed;
mod plan;
mod protobuf;
pub(super) mod rewrite;
mod walk;

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use self::encoding::{Encoding, HEADER, encapsulated};
use self::json::Pick;
use self::lists::Lists;
use self::malformed::Malformed;
use self::plan::{Plan, Rules, Sizes};
use self::protobuf::ProtobufPlan;
use crate::imu::schema::layout::{Layout, Place, Wire};
use crate::imu::schema::lookup::PathError;
use crate::imu::schema::path::{Element, FieldPath};

/// Decoder of the same few numbers in each message of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decoder(Encoding);

impl Decoder {
    /// Decoder for `numbers` and for a text (empty if none is requested).
    ///
    /// # Errors
    /// If the layout does not allow to locate one of them in every message.
    pub fn new(layout: &Layout, numbers: &[Place], text: Option<&Place>) -> Result<Self, PathError> {
        unmixed(numbers)?;
        let plan = |align, sizes| Plan::new(layout, numbers, text, Rules { align, sizes });
        Ok(Self(match layout.wire {
            Wire::Cdr => Encoding::Cdr {
                xcdr1: plan(8, Sizes::None)?,
                xcdr2: plan(4, Sizes::Lists)?,
                delimited: plan(4, Sizes::Messages)?,
            },
            Wire::Ros1 => Encoding::Ros1(plan(1, Sizes::None)?),
            Wire::Protobuf => Encoding::Protobuf(ProtobufPlan::new(layout, numbers, text)?),
            Wire::Json => Encoding::Json(Pick::new(numbers, text)),
        }))
    }

    /// Decodes one message: the numbers in the requested order, and the text. Integers beyond 2⁵³ are rounded. In
    /// protobuf and JSON, a missing number is NaN.
    ///
    /// # Errors
    /// If the message is shorter than its schema demands, or in an unsupported encoding. `numbers` may have changed
    /// then.
    pub fn read<'d>(&self, data: &'d [u8], numbers: &mut [f64]) -> Result<Cow<'d, [u8]>, Malformed> {
        self.read_lists(data, numbers, &mut Lists::default())
    }

    /// Decodes one message whose numbers may be in every element of a list: `lists` receives a column for each of these,
    /// with as many numbers as there are elements.
    ///
    /// # Errors
    /// Also if a list is longer than any sensor fills it.
    pub(in crate::imu) fn read_lists<'d>(
        &self,
        data: &'d [u8],
        numbers: &mut [f64],
        lists: &mut Lists,
    ) -> Result<Cow<'d, [u8]>, Malformed> {
        lists.restart();
        let text = match &self.0 {
            Encoding::Json(pick) => pick.read(data, numbers, lists)?,
            Encoding::Protobuf(protobuf) => Cow::Borrowed(protobuf.read(data, numbers, lists)?),
            Encoding::Ros1(plan) => Cow::Borrowed(plan.walk::<false, false>(data, 0, numbers, lists)?),
            Encoding::Cdr { xcdr1, xcdr2, delimited } => match encapsulated(data, xcdr1, xcdr2, delimited)? {
                (plan, true) => Cow::Borrowed(plan.walk::<true, false>(data, HEADER, numbers, lists)?),
                (plan, false) => Cow::Borrowed(plan.walk::<false, false>(data, HEADER, numbers, lists)?),
            },
        };
        if lists.is_over() { Err(Malformed::Long) } else { Ok(text) }
    }
}

/// Refuses places in one element of a list of which another place wants all.
fn unmixed(numbers: &[Place]) -> Result<(), PathError> {
    for listed in numbers {
        let Some(depth) = listed.hops.iter().position(|hop| matches!(hop.element, Some(Element::Each(_)))) else {
            continue;
        };
        let fields = |place: &Place| place.hops.iter().take(depth + 1).map(|hop| hop.field).collect::<Vec<_>>();
        let list = fields(listed);
        let in_one = |place: &&Place| {
            place.hops.get(depth).is_some_and(|hop| matches!(hop.element, Some(Element::At(_))))
                && fields(place) == list
        };
        if let Some(place) = numbers.iter().find(in_one) {
            let names = place.path.segments().iter().take(depth + 1);
            let path = names.fold(FieldPath::default(), |path, segment| path.join(&segment.name));
            return Err(PathError::Mixed { path: path.to_string() });
        }
    }
    Ok(())
}
