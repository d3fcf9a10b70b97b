//! Which texts may stand in a file, so that every target can hold them.
//!
//! A name goes into file names, generated code, XML and figures; a line of text
//! goes into comments, pages and onto terminals. What they may hold is checked
//! where they are read, and nothing is left for an export to be surprised by.

use std::fmt;

/// Longest name, in characters: longer ones fit neither the tables nor the
/// file names of every system.
pub const LONGEST_NAME: usize = 64;
/// Longest line of text, in characters.
pub const LONGEST_LINE: usize = 1000;

/// What is wrong with a name or a line of text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TextFault {
    /// There is nothing but blanks.
    Empty,
    /// A name without any letter or digit.
    NoLetter,
    /// More characters than fit.
    Long {
        /// How many there are.
        length: usize,
        /// How many there may be.
        most: usize,
    },
    /// A character that not every target can hold.
    Character {
        /// Which.
        character: char,
        /// The how manieth of the text it is, from 1.
        column: usize,
    },
}

impl fmt::Display for TextFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => f.write_str("it is empty"),
            Self::NoLetter => f.write_str("it holds no letter and no digit"),
            Self::Long { length, most } => {
                write!(f, "it has {length} characters where {most} are the most")
            }
            Self::Character { character, column } => {
                write!(f, "character {column} is {}", described(*character))
            }
        }
    }
}

/// A character as a message can show it.
fn described(character: char) -> String {
    if is_plain(character) {
        format!("`{character}`")
    } else {
        format!("U+{:04X}, which cannot be shown", u32::from(character))
    }
}

/// Whether a character is seen as itself: no control character, no line or
/// paragraph separator, and none that is invisible or turns the direction of
/// the text around it.
fn is_plain(character: char) -> bool {
    !character.is_control()
        && !matches!(
            character,
            '\u{ad}'
                | '\u{61c}'
                | '\u{180e}'
                | '\u{200b}'..='\u{200f}'
                | '\u{2028}'..='\u{202e}'
                | '\u{2060}'..='\u{206f}'
                | '\u{feff}'
                | '\u{fff0}'..='\u{fffb}'
                | '\u{fffe}'
                | '\u{ffff}'
                | '\u{e0000}'..='\u{e0fff}'
        )
}

/// Checks a name: letters of ASCII, digits, blanks, `-`, `_` and `.`, at most
/// [`LONGEST_NAME`], with a letter or digit among them.
///
/// # Errors
/// The first thing that is wrong.
pub fn check_name(text: &str) -> Result<(), TextFault> {
    if text.trim().is_empty() {
        return Err(TextFault::Empty);
    }
    let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, ' ' | '-' | '_' | '.');
    if let Some((index, character)) = text.chars().enumerate().find(|(_, c)| !allowed(*c)) {
        return Err(TextFault::Character { character, column: index + 1 });
    }
    // Every character is one byte here.
    if text.len() > LONGEST_NAME {
        return Err(TextFault::Long { length: text.len(), most: LONGEST_NAME });
    }
    if !text.contains(|c: char| c.is_ascii_alphanumeric()) {
        return Err(TextFault::NoLetter);
    }
    Ok(())
}

/// Checks a line of text: at most [`LONGEST_LINE`] characters, each of which is
/// seen as itself.
///
/// # Errors
/// The first thing that is wrong.
pub fn check_line(text: &str) -> Result<(), TextFault> {
    if text.trim().is_empty() {
        return Err(TextFault::Empty);
    }
    if let Some((index, character)) = text.chars().enumerate().find(|(_, c)| !is_plain(*c)) {
        return Err(TextFault::Character { character, column: index + 1 });
    }
    let length = text.chars().count();
    if length > LONGEST_LINE {
        return Err(TextFault::Long { length, most: LONGEST_LINE });
    }
    Ok(())
}

/// A text with every character that is not seen as itself shown by a sign of
/// its own, one for one, so that neither a terminal nor XML obeys or refuses
/// it. Tabs stay where `tabs` is set.
pub fn visible(text: &str, tabs: bool) -> String {
    text.chars()
        .map(|c| match c {
            '\t' if tabs => c,
            c if is_plain(c) => c,
            // The signs for control characters stand in the same order.
            '\0'..='\x1f' => char::from_u32(0x2400 + u32::from(c)).unwrap_or('\u{fffd}'),
            '\x7f' => '\u{2421}',
            _ => '\u{fffd}',
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_hold_what_every_target_can_hold() {
        for name in ["coax2d", "CoAX 2D", "a-b_c.d", "7", &"x".repeat(LONGEST_NAME)] {
            assert_eq!(check_name(name), Ok(()), "{name}");
        }
        let column = |text: &str| match check_name(text) {
            Err(TextFault::Character { column, .. }) => column,
            other => panic!("{text:?}: {other:?}"),
        };
        for (text, expected) in [
            ("@PLACES@", 1),
            ("x *\u{2f} y", 3),
            ("a\"b", 2),
            ("tab\t", 4),
            ("Hubschrauber \u{fc}", 14),
            ("\u{202e}", 1),
        ] {
            assert_eq!(column(text), expected, "{text:?}");
        }
        assert_eq!(check_name(" "), Err(TextFault::Empty));
        assert_eq!(check_name("-._"), Err(TextFault::NoLetter));
        let long = "x".repeat(70_000);
        assert_eq!(check_name(&long), Err(TextFault::Long { length: 70_000, most: LONGEST_NAME }));
    }

    #[test]
    fn lines_hold_what_is_seen() {
        assert_eq!(check_line("Ein Hubschrauber für zwei, 40 % < 50 %"), Ok(()));
        assert!(matches!(check_line("a\nb"), Err(TextFault::Character { column: 2, .. })));
        assert!(matches!(check_line("\u{1b}[2J"), Err(TextFault::Character { column: 1, .. })));
        assert!(matches!(check_line(&"é".repeat(1001)), Err(TextFault::Long { length: 1001, .. })));
        let shown = check_line("\u{1b}[2J").unwrap_err().to_string();
        assert_eq!(shown, "character 1 is U+001B, which cannot be shown");
    }

    proptest::proptest! {
        /// Nothing that acts is left, and the columns stay.
        #[test]
        fn visible_text_acts_on_nothing(text in proptest::prelude::any::<String>()) {
            let shown = visible(&text, false);
            proptest::prop_assert!(shown.chars().all(is_plain));
            proptest::prop_assert_eq!(shown.chars().count(), text.chars().count());
        }

        /// A name is a line too.
        #[test]
        fn names_are_lines(text in "[ -~]{0,80}") {
            if check_name(&text).is_ok() {
                proptest::prop_assert_eq!(check_line(&text), Ok(()));
            }
        }
    }
}
