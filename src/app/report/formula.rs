//! A formula that was found, in words.

use crate::formula::{FoundFormula, Rival, Verdict};
use crate::names::rounded;
use crate::report::text_table;

/// The verdict on a formula, the formula, and a table of its terms; of motion that it does not explain, where it does not.
pub fn formula_text(found: &FoundFormula, friction: bool, of_model: bool) -> String {
    let verdict = match found.verdict {
        Verdict::Found if found.several => "found, one of several",
        Verdict::Found => "found",
        Verdict::NotInLibrary => "not in the library",
        Verdict::Undecided => "undecided",
    };
    let (searched, removed) = found.searched;
    let residual = rounded(found.residual, 4);
    let mut text = if of_model {
        format!("{verdict}: accelerations differ from the model's by {residual} of their size\n")
    } else {
        let bound = if found.noise_resolved { "" } else { ", which is at most what was assumed" };
        format!("{verdict}: the residual of held-out motion is {residual} times its noise{bound}\n")
    };
    text += &found.doubts.iter().map(|doubt| format!("in doubt: {doubt}\n")).collect::<String>();
    text += &format!("{searched} terms searched, {removed} of them total derivatives or sums of others\n");
    if found.tried.len() > 1 {
        text += &format!("functions of {}; searched: {}\n", found.basis, found.tried.join("; "));
    }
    text += &found.notes.iter().map(|note| format!("{note}\n")).collect::<String>();
    text += &blocks(found);
    text += "\n";
    text += &format!("L = {}\n", found.text(false));
    if friction {
        text += &format!("D = {}\n", found.text(true));
    }
    let rows = found.terms.iter().map(|t| {
        let range = [-1.96, 1.96].map(|k| rounded(t.coefficient + k * t.standard_error, 6)).join(" .. ");
        let name = if t.dissipation { format!("D: {}", t.term) } else { t.term.clone() };
        let near = t.near.as_ref().map_or(String::new(), |near| match rounded(near.standard_errors, 1) {
            off if near.standard_errors == 0.0 || off == "0" => near.fraction.clone(),
            off => format!("{} ({off} errors off)", near.fraction),
        });
        let unit = t.unit.clone().unwrap_or_else(|| "hidden in the function".to_string());
        let [coefficient, error] = [rounded(t.coefficient, 6), rounded(t.standard_error, 2)];
        vec![name, t.constant.clone(), coefficient, error, range, unit, format!("{:.2}", t.probability), near]
    });
    let headers = ["term", "constant", "coefficient", "error", "95 % range", "unit", "probability", "near"];
    text += &format!("\n{}", text_table(&headers, &rows.collect::<Vec<_>>()));
    if let Some(Rival { terms, cost }) = &found.rival {
        let terms = terms.join(", ");
        text +=
            &format!("\nnext best: {terms}; it costs {} units of noise more, a term counts 30\n", rounded(*cost, 3));
    }
    if found.verdict == Verdict::NotInLibrary && !found.left.is_empty() {
        let rows = found.left.iter().map(|left| {
            let name = found.coordinates[left.coordinate].clone();
            vec![name, rounded(left.low, 4), rounded(left.high, 4), rounded(left.residual, 4), left.samples.to_string()]
        });
        let headers = ["coordinate", "from", "to", "residual over noise", "samples"];
        text += &format!("\nwhat is left:\n{}", text_table(&headers, &rows.collect::<Vec<_>>()));
    }
    text
}

/// What moves by itself.
fn blocks(found: &FoundFormula) -> String {
    let Some((first, others)) = found.blocks.split_first() else { return String::new() };
    let first = first.join(", ");
    let sentence = |names: &Vec<String>| {
        let (verb, whose) = if names.len() == 1 { ("moves by itself", "its") } else { ("move by themselves", "their") };
        let names = names.join(", ");
        if found.between.is_some() {
            return format!("{names} {verb}, apart from {first}\n");
        }
        format!("{names} {verb}: {whose} mass relative to that of {first} is not determined\n")
    };
    others.iter().map(sentence).collect()
}
