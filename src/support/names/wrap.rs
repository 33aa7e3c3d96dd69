//! Text in lines of bounded width.

/// Columns of a terminal that texts and tables keep to.
pub const WIDTH: usize = 120;

/// Width of a text in characters.
pub fn width(text: &str) -> usize {
    text.chars().count()
}

/// Lines of at most `most` characters, cut at blanks, but not between a number and its `%`; a word that is longer has a line of
/// its own.
pub fn cut(text: &str, most: usize) -> Vec<String> {
    let (mut lines, mut words) = (Vec::<String>::new(), Vec::<String>::new());
    for word in text.split(' ').filter(|word| !word.is_empty()) {
        match words.last_mut().filter(|_| word.starts_with('%')) {
            Some(number) => *number += &format!(" {word}"),
            None => words.push(word.to_string()),
        }
    }
    for word in &words {
        match lines.last_mut() {
            Some(line) if width(line) + 1 + width(word) <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_string()),
        }
    }
    if lines.is_empty() {
        lines.push(String::new());
    }
    lines
}

/// The same with words cut too, where nothing else fits.
pub fn cut_hard(text: &str, most: usize) -> Vec<String> {
    let most = most.max(1);
    let pieces = |line: String| -> Vec<String> {
        let letters: Vec<char> = line.chars().collect();
        let chunks = letters.chunks(most).map(|chunk| chunk.iter().collect());
        if letters.is_empty() { vec![String::new()] } else { chunks.collect() }
    };
    cut(text, most).into_iter().flat_map(pieces).collect()
}

/// A text with every line that is longer than `most` cut at blanks; what follows stands below the text of that line: behind
/// its indentation and, of two columns, behind the first one.
pub fn wrap_text(text: &str, most: usize) -> String {
    let mut whole = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        let (body, end) = line.strip_suffix('\n').map_or((line, ""), |body| (body, "\n"));
        if width(body) <= most {
            whole.push_str(line);
            continue;
        }
        let indent = hang(body, most);
        let head: String = body.chars().take(indent).collect();
        let rest: String = body.chars().skip(indent).collect();
        let lines = cut(&rest, most - indent);
        whole.push_str(&head);
        whole.push_str(&lines.join(&format!("\n{}", " ".repeat(indent))));
        whole.push_str(end);
    }
    whole
}

/// Where the text of a line begins: behind its indentation, or behind the first column of two that blanks part.
fn hang(line: &str, most: usize) -> usize {
    let indent = line.chars().take_while(|c| *c == ' ').count();
    let letters: Vec<char> = line.chars().collect();
    let gap = (indent + 1..letters.len().saturating_sub(2)).find(|&k| letters[k..k + 2] == [' ', ' ']);
    let second = gap.map(|gap| gap + letters[gap..].iter().take_while(|c| **c == ' ').count());
    second.filter(|second| 2 * second <= most).unwrap_or(if 2 * indent <= most { indent } else { 0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_cut_at_blanks() {
        assert_eq!(cut("one two  three", 7), ["one two", "three"]);
        assert_eq!(cut("below 5 %, said", 7), ["below", "5 %,", "said"]);
        assert_eq!(cut("immeasurable x", 4), ["immeasurable", "x"]);
        assert_eq!(cut_hard("immeasurable x", 5), ["immea", "surab", "le", "x"]);
        assert_eq!((cut("", 3), cut_hard("", 3)), (vec![String::new()], vec![String::new()]));
    }

    #[test]
    fn only_long_lines_are_wrapped() {
        assert_eq!(wrap_text("short\n\n  a line of words\nend", 10), "short\n\n  a line\n  of words\nend");
        let two = "  --seed <N>  seed of the states and of the weights\n";
        assert_eq!(
            wrap_text(two, 30),
            "  --seed <N>  seed of the\n              states and of\n              the weights\n"
        );
        assert!(wrap_text(&"word ".repeat(100), WIDTH).lines().all(|line| width(line) <= WIDTH));
    }
}
