//! "Did you mean": the known name nearest to one that is not known.

/// The name among `known` nearest to `name` in spelling.
///
/// Joint names share their leg, so the distance weighs a common start (Jaro-Winkler); and `FR_knee`, a word of other makers,
/// means the calf although `FR_hip` is spelt more like it.
pub(crate) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let synonyms = [
        ("knee", "calf"),
        ("shin", "calf"),
        ("abduction", "hip"),
        ("abad", "hip"),
    ];
    let wanted = synonyms
        .iter()
        .fold(name.to_lowercase(), |name, (theirs, ours)| {
            name.replace(theirs, ours)
        });
    let likeness = |known: &str| strsim::jaro_winkler(&wanted, &known.to_lowercase());
    known
        .into_iter()
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)))
}
