//! Elements of XML files, one after another, without a tree of them in memory.

use std::borrow::Cow;
use std::str::FromStr;

use quick_xml::events::BytesStart;
use quick_xml::{Reader, XmlVersion};

use super::words::no_number;
use super::{EXPORT_AGAIN, Fault};

/// A reader over UTF-8.
pub(super) fn reader(bytes: &[u8]) -> Reader<&[u8]> {
    Reader::from_reader(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
}

/// The fault of a file that is no valid XML.
pub(super) fn malformed(error: impl std::fmt::Display) -> Fault {
    Fault::new(format!("is not valid XML: {error}"), EXPORT_AGAIN)
}

/// The value of an attribute by its name without prefix; none where there is none.
pub(super) fn attribute<'e>(
    element: &'e BytesStart<'_>,
    name: &str,
) -> Result<Option<Cow<'e, str>>, Fault> {
    for attribute in element.attributes().with_checks(false) {
        let attribute = attribute.map_err(malformed)?;
        if attribute.key.local_name().as_ref() == name.as_bytes() {
            let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(malformed)?;
            return Ok(Some(Cow::Owned(value.into_owned())));
        }
    }
    Ok(None)
}

/// A number that an element has to have.
pub(super) fn number<T: FromStr>(element: &BytesStart<'_>, name: &str) -> Result<T, Fault> {
    for attribute in element.attributes().with_checks(false) {
        let attribute = attribute.map_err(malformed)?;
        if attribute.key.as_ref() == name.as_bytes() {
            let value = attribute.value.trim_ascii();
            let number = str::from_utf8(value).ok().and_then(|text| text.parse().ok());
            return number.ok_or_else(|| no_number(value, name));
        }
    }
    let element = element.name();
    let element = String::from_utf8_lossy(element.as_ref());
    Err(Fault::new(format!("an element `{element}` lacks `{name}`"), EXPORT_AGAIN))
}
