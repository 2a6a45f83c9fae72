//! Text and pictures as HTML.

use base64::{Engine, engine::general_purpose::STANDARD};

/// A picture, PNG or GIF, as an element. The caption is its alternative text.
pub(crate) fn image(bytes: &[u8], caption: &str) -> String {
    let kind = if bytes.starts_with(b"GIF") { "gif" } else { "png" };
    let (data, caption) = (STANDARD.encode(bytes), escape(caption));
    format!("<img alt=\"{caption}\" src=\"data:image/{kind};base64,{data}\">")
}

/// Text as HTML.
pub(crate) fn escape(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}
