/// The words and punctuation of a Rust text, without comments, strings and characters.
pub(crate) fn words(text: &str) -> Vec<String> {
    let chars: Vec<char> = text.chars().collect();
    let at = |k: usize| chars.get(k).copied().unwrap_or('\0');
    let is_word = |c: char| c.is_alphanumeric() || c == '_' || c == '$';
    let mut words = Vec::new();
    let mut k = 0;
    while k < chars.len() {
        match (at(k), at(k + 1)) {
            ('/', '/') => {
                while k < chars.len() && at(k) != '\n' {
                    k += 1;
                }
            }
            ('/', '*') => {
                let mut depth = 0;
                loop {
                    match (at(k), at(k + 1)) {
                        ('/', '*') => (depth, k) = (depth + 1, k + 2),
                        ('*', '/') => (depth, k) = (depth - 1, k + 2),
                        _ => k += 1,
                    }
                    if depth == 0 || k >= chars.len() {
                        break;
                    }
                }
            }
            ('r' | 'b', _) if raw(&chars, k).is_some() => {
                let (start, hashes) = raw(&chars, k).unwrap_or_default();
                k = start;
                while k < chars.len()
                    && !(at(k) == '"' && (1..=hashes).all(|hash| at(k + hash) == '#'))
                {
                    k += 1;
                }
                k += 1 + hashes;
            }
            ('"', _) => k = behind(&chars, k, '"'),
            // A character, not a lifetime.
            ('\'', next) if next == '\\' || at(k + 2) == '\'' => k = behind(&chars, k, '\''),
            ('\'', _) => {
                k += 1;
                while is_word(at(k)) {
                    k += 1;
                }
            }
            (':', ':') => {
                words.push("::".to_owned());
                k += 2;
            }
            (first, _) if is_word(first) => {
                let start = k;
                while is_word(at(k)) {
                    k += 1;
                }
                words.push(chars[start..k].iter().collect());
            }
            (sign, _) => {
                if !sign.is_whitespace() {
                    words.push(sign.to_string());
                }
                k += 1;
            }
        }
    }
    words
}

/// The start of the content of a raw string at `k`, and the number of signs that delimit it, if there is one.
fn raw(chars: &[char], k: usize) -> Option<(usize, usize)> {
    let before = k.checked_sub(1).and_then(|k| chars.get(k));
    if before.is_some_and(|c| c.is_alphanumeric() || *c == '_') {
        return None;
    }
    let start = if chars[k] == 'b' { k + 1 } else { k };
    if chars.get(start) != Some(&'r') {
        return None;
    }
    let hashes = chars[start + 1..].iter().take_while(|&&c| c == '#').count();
    let quote = start + 1 + hashes;
    (chars.get(quote) == Some(&'"')).then_some((quote + 1, hashes))
}

/// The position after a string that starts at `k`.
fn behind(chars: &[char], k: usize, quote: char) -> usize {
    let mut k = k + 1;
    while k < chars.len() && chars[k] != quote {
        k += if chars[k] == '\\' { 2 } else { 1 };
    }
    k + 1
}
