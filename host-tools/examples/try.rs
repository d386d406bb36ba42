fn main() {
    let logs: Vec<std::path::PathBuf> = std::env::args().skip(1).map(Into::into).collect();
    proprio::criticism::try_out(&logs);
}
