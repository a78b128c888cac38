//! The pictures that Dynamic Depth 1.0 appends to a photo. Their directory lies in the photo's XMP or, as Google's
//! camera writes it, in the extended XMP.

use super::ITEM;
use crate::input::jpeg_end;
use roxmltree::{Document, Node};

/// An entry of the directory.
struct Item<'a> {
    uri: Option<&'a str>,
    length: Option<usize>,
    /// The number of bytes between it and the next one.
    padding: usize,
}

/// Returns the bytes of the item called `uri`. The first item of the directory is the photo itself, and the others
/// follow it in order. Cameras write data of their own before or behind all of them, so that they are looked for behind
/// the photo, and before the end of the file.
pub(super) fn item<'a>(
    documents: &[&Document<'_>],
    jpeg: &'a [u8],
    uri: &str,
) -> std::result::Result<&'a [u8], String> {
    let nodes = documents.iter().flat_map(|xml| xml.descendants());
    let items: Vec<Item<'_>> = nodes.filter(is_item).map(Item::new).collect();
    let (photo, appended) = items.split_first().ok_or("its Dynamic Depth lists no items")?;
    let place = appended
        .iter()
        .position(|item| item.uri == Some(uri))
        .ok_or_else(|| format!("its Dynamic Depth names {uri}, but no such item is in the file"))?;
    let sum = |items: &[Item<'_>]| {
        let mut lengths = items.iter().map(|item| item.length?.checked_add(item.padding));
        lengths.try_fold(0usize, |sum, length| sum.checked_add(length?))
    };
    let length = appended[place]
        .length
        .ok_or("an item of its Dynamic Depth has no length")?;
    let behind_photo = || (jpeg_end::end(jpeg)?.checked_add(photo.padding)?).checked_add(sum(&appended[..place])?);
    let before_end = || jpeg.len().checked_sub(sum(&appended[place..])?);
    let at = |start: Option<usize>| jpeg.get(start?..)?.get(..length);
    [at(behind_photo()), at(before_end())]
        .into_iter()
        .flatten()
        .find(|bytes| image::guess_format(bytes).is_ok())
        .ok_or_else(|| format!("its Dynamic Depth names {uri}, and no picture lies where it says; it was cut when the photo was edited or sent: take the original"))
}

/// Checks whether `node` has the properties of an item: `Container:Item`, or `rdf:value` as Google's camera writes it.
fn is_item(node: &Node<'_, '_>) -> bool {
    own(*node, "Mime").is_some()
}

/// Returns a property of `node`, an attribute or a child.
fn own<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    let child = || node.children().find(|child| child.has_tag_name((ITEM, name)))?.text();
    node.attribute((ITEM, name)).or_else(child)
}

impl<'a> Item<'a> {
    fn new(node: Node<'a, '_>) -> Self {
        let number = |name| own(node, name).and_then(|text| text.trim().parse().ok());
        Item {
            uri: own(node, "DataURI"),
            length: number("Length"),
            padding: number("Padding").unwrap_or(0),
        }
    }
}
