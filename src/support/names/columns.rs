//! Columns of results beside those of coordinates.

/// The first coordinate that has the name of another column, and what that column is: results have the time as `t`, or as `tau` beside a
/// coordinate `t`, the energy, and for every coordinate `NAME_dot`, `NAME_ddot` and `NAME_force`.
pub fn taken_column(coordinates: &[&str]) -> Option<(usize, String)> {
    coordinates.iter().enumerate().find_map(|(index, name)| {
        let of_another = |end: &str| name.strip_suffix(end).filter(|other| coordinates.contains(other));
        let column = match *name {
            "energy" => "the energy of results".to_string(),
            "tau" if coordinates.contains(&"t") => "the time of results beside a coordinate t".to_string(),
            _ => {
                let ends = [("_dot", "velocity"), ("_ddot", "acceleration"), ("_force", "force")];
                let (other, what) = ends.iter().find_map(|(end, what)| Some((of_another(end)?, what)))?;
                format!("the {what} of {other}")
            }
        };
        Some((index, format!("{name} is the column of {column}, expected another name")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_columns_are_found() {
        let taken = |names: &[&str]| taken_column(names).map(|(index, _)| index);
        for (names, index) in [
            (&["x", "energy"][..], Some(1)),
            (&["energy"], Some(0)),
            (&["t", "tau"], Some(1)),
            (&["tau", "t"], Some(0)),
            (&["x_dot", "x"], Some(0)),
            (&["x", "x_ddot"], Some(1)),
            (&["x", "x_force"], Some(1)),
            (&["tau", "x"], None),
            (&["t", "x"], None),
            (&["x", "y_dot", "y_force", "my_energy", "_dot"], None),
        ] {
            assert_eq!(taken(names), index, "{names:?}");
        }
    }
}
