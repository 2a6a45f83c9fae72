//! Links of the documents are valid, and sections cited in code exist.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod repository;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use repository::{files, root, shown};

/// Base addresses of repository files on the web.
const ON_THE_WEB: [&str; 2] = [
    "https://github.com/softrast/softrast/blob/main/",
    "https://github.com/softrast/softrast/tree/main/",
];

#[test]
fn every_link_of_a_document_leads_to_a_file_and_a_heading() {
    let (mut dead, mut count) = (Vec::new(), 0);
    for page in files(root(), "md") {
        let text = fs::read_to_string(&page).unwrap();
        for link in links(&text) {
            count += 1;
            if let Some(reason) = fault(&page, &link) {
                dead.push(format!("  {}: {link}: {reason}", shown(&page)));
            }
        }
    }
    assert!(count > 100, "the links of the documents are found, not {count} alone");
    assert!(dead.is_empty(), "{} dead links:\n{}", dead.len(), dead.join("\n"));
}

#[test]
fn every_section_of_the_notes_that_is_cited_exists() {
    let notes = fs::read_to_string(root().join("docs/notes.md")).unwrap();
    let sections: BTreeSet<String> = headings(&notes).into_iter().collect();
    let (mut wrong, mut count) = (Vec::new(), 0);
    for extension in ["rs", "py", "md", "toml", "js"] {
        for path in files(root(), extension) {
            if path.starts_with(env!("CARGO_MANIFEST_DIR")) {
                continue;
            }
            let text = fs::read_to_string(&path).unwrap();
            for cited in citations(&text) {
                count += 1;
                if !sections.iter().any(|section| begins_with_name(&cited, section)) {
                    wrong.push(format!("  {}: {cited}", shown(&path)));
                }
            }
        }
    }
    assert!(count > 30, "citations are found, not {count} alone");
    assert!(wrong.is_empty(), "no such section of docs/notes.md:\n{}", wrong.join("\n"));
}

#[test]
fn the_summary_of_the_book_lists_every_page_once() {
    let docs = root().join("docs");
    let summary = fs::read_to_string(docs.join("SUMMARY.md")).unwrap();
    let mut listed = links(&summary);
    listed.sort();
    let mut pages: Vec<String> = files(&docs, "md")
        .iter()
        .map(|page| page.strip_prefix(&docs).unwrap().display().to_string().replace('\\', "/"))
        .filter(|page| page != "SUMMARY.md")
        .collect();
    pages.sort();
    assert_eq!(listed, pages);
}

#[test]
fn pages_of_the_book_link_within_it_or_to_the_web() {
    let docs = root().join("docs");
    let mut outside = Vec::new();
    for page in files(&docs, "md") {
        let folder = page.parent().unwrap().strip_prefix(&docs).unwrap();
        for link in links(&fs::read_to_string(&page).unwrap()) {
            // Folders below `docs` are one deep.
            if link.starts_with("../../")
                || (folder.as_os_str().is_empty() && link.starts_with("../"))
            {
                outside.push(format!("  {}: {link}", shown(&page)));
            }
        }
    }
    let found = outside.join("\n");
    assert!(outside.is_empty(), "take the address of the repository on the web:\n{found}");
}

#[test]
fn every_example_and_benchmark_that_a_command_names_exists() {
    let sources = files(root(), "rs");
    let exists = |folder: &str, name: &str| {
        let [file, with_parts] =
            [format!("{folder}/{name}.rs"), format!("{folder}/{name}/main.rs")];
        sources.iter().any(|path| path.ends_with(&file) || path.ends_with(&with_parts))
    };
    let scripts = fs::read_dir(root().join(".ci")).unwrap().map(|entry| entry.unwrap().path());
    let scripts = scripts.filter(|path| path.is_file());
    let (mut missing, mut count) = (Vec::new(), 0);
    for page in files(root(), "md").into_iter().chain(scripts) {
        let text = String::from_utf8_lossy(&fs::read(&page).unwrap()).into_owned();
        for (flag, folder) in [("--example ", "examples"), ("--bench ", "benches")] {
            for (at, _) in text.match_indices(flag) {
                let named =
                    |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "_-".contains(c);
                let rest = &text[at + flag.len()..];
                let name = &rest[..rest.find(|c| !named(c)).unwrap_or(rest.len())];
                count += usize::from(!name.is_empty());
                // Logs and the changelog name what there was; NAME stands for any name.
                let is_log =
                    page.starts_with(root().join("docs/log")) || page.ends_with("CHANGELOG.md");
                if !name.is_empty() && !is_log && !exists(folder, name) {
                    missing.push(format!("  {}: {flag}{name}", shown(&page)));
                }
            }
        }
    }
    assert!(count > 20, "commands are found, not {count} alone");
    assert!(missing.is_empty(), "there is no such file:\n{}", missing.join("\n"));
}

/// Why a link on a page leads nowhere, if it does not.
fn fault(page: &Path, link: &str) -> Option<String> {
    let on_the_web = ON_THE_WEB.iter().find_map(|start| link.strip_prefix(start));
    let is_elsewhere = ["http:", "https:", "mailto:", "data:"].iter().any(|x| link.starts_with(x));
    if on_the_web.is_none() && is_elsewhere {
        return None;
    }
    let (path, anchor) =
        on_the_web.unwrap_or(link).split_once('#').unwrap_or((on_the_web.unwrap_or(link), ""));
    let folder = if on_the_web.is_some() { root() } else { page.parent().unwrap() };
    let target = if path.is_empty() { page.to_owned() } else { folder.join(path) };
    if !target.exists() {
        return Some("there is no such file".to_owned());
    }
    let is_page = target.extension().is_some_and(|extension| extension == "md");
    if anchor.is_empty() || !is_page {
        return None;
    }
    let text = fs::read_to_string(&target).unwrap();
    (!anchors(&text).contains(anchor)).then(|| "there is no such heading".to_owned())
}

/// The lines of a page outside of code blocks, without inline code.
fn prose(text: &str) -> String {
    let mut fenced = false;
    let mut prose = String::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if !fenced {
            prose.extend(line.split('`').step_by(2));
        }
        prose.push('\n');
    }
    prose
}

/// The targets of the links and pictures of a page.
fn links(text: &str) -> Vec<String> {
    let prose = prose(text);
    let mut found = Vec::new();
    for (start, end) in [("](", ")"), ("src=\"", "\""), ("href=\"", "\"")] {
        let rests = prose.match_indices(start).map(|(at, _)| &prose[at + start.len()..]);
        found.extend(rests.filter_map(|rest| rest.find(end).map(|end| &rest[..end])));
    }
    // `[name]: target`
    found.extend(prose.lines().filter_map(|line| {
        line.strip_prefix('[').filter(|line| !line.starts_with('^'))?.split_once("]: ").map(|x| x.1)
    }));
    // A title may follow the target.
    found.iter().map(|link| link.split_whitespace().next().unwrap_or_default().to_owned()).collect()
}

/// The titles of the headings of a page, as rendered.
fn headings(text: &str) -> Vec<String> {
    let mut fenced = false;
    let mut found = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if !fenced && line.starts_with('#') {
            let title = line.trim_start_matches('#');
            if title.starts_with(' ') {
                found.push(as_read(title.trim()));
            }
        }
    }
    found
}

/// A title without the markup of links, code and emphasis.
fn as_read(title: &str) -> String {
    let mut read = String::new();
    let mut rest = title;
    while let Some((before, after)) = rest.split_once('[') {
        let Some((words, behind)) = after.split_once("](") else { break };
        read += before;
        read += words;
        rest = behind.split_once(')').map_or("", |x| x.1);
    }
    read += rest;
    read.replace(['`', '*'], "")
}

/// Anchors that GitHub assigns to the headings of a page, and explicit ones.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    for title in headings(text) {
        let kept = |c: &char| c.is_alphanumeric() || [' ', '-', '_'].contains(c);
        let name: String = title.to_lowercase().chars().filter(kept).collect();
        let name = name.replace(' ', "-");
        let times = seen.entry(name.clone()).or_default();
        found.insert(if *times == 0 { name } else { format!("{name}-{times}") });
        *times += 1;
    }
    for mark in ["id=\"", "name=\""] {
        let rests = text.match_indices(mark).map(|(at, _)| &text[at + mark.len()..]);
        found.extend(rests.filter_map(|rest| rest.split_once('"').map(|x| x.0.to_owned())));
    }
    found
}

/// The section cited after each `docs/notes.md, `, in one line.
fn citations(text: &str) -> Vec<String> {
    let lines = text.lines().map(|line| line.trim().trim_start_matches(['/', '!', '#']).trim());
    let text = lines.collect::<Vec<_>>().join(" ");
    let mark = "docs/notes.md, ";
    let found = text.match_indices(mark).map(|(at, _)| &text[at + mark.len()..]);
    found.map(|rest| rest.chars().take(60).collect()).collect()
}

/// Whether a text starts with a name that ends at a word boundary.
fn begins_with_name(text: &str, name: &str) -> bool {
    text.strip_prefix(name).is_some_and(|rest| !rest.starts_with(char::is_alphanumeric))
}

#[test]
fn headings_have_the_anchors_of_github() {
    let text = "# `a_b` and *C*: 2D\n## Same\n## Same\n```\n# no heading\n```\n### [Link](x.md), ü\n<a id=\"own\"></a>\n";
    let expected = ["a_b-and-c-2d", "same", "same-1", "link-ü", "own"].map(str::to_owned);
    assert_eq!(anchors(text), BTreeSet::from(expected));
}

#[test]
fn links_are_found_outside_of_code() {
    let text = "[a](b.md#c \"title\") ![p](q.png) `[x](y)`\n```\n[z](w)\n```\n<img src=\"i.png\">\n[r]: s.md\n";
    assert_eq!(links(text), ["b.md#c", "q.png", "i.png", "s.md"]);
}

#[test]
fn a_dead_file_and_a_dead_heading_are_faults() {
    let folder = tempfile::tempdir().unwrap();
    let page: PathBuf = folder.path().join("page.md");
    fs::write(&page, "# Here\n").unwrap();
    for (link, dead) in [
        ("#here", false),
        ("page.md#here", false),
        ("https://example.org/#x", false),
        ("#there", true),
        ("page.md#there", true),
        ("none.md", true),
        ("https://github.com/softrast/softrast/blob/main/README.md", false),
        ("https://github.com/softrast/softrast/blob/main/NONE.md", true),
    ] {
        assert_eq!(fault(&page, link).is_some(), dead, "{link}");
    }
}
