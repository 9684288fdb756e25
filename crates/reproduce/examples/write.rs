//! Writes the page and its pictures into a folder: `cargo run --release -p mapper-reproduce --example write -- DIR`.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

fn main() {
    let folder = std::path::PathBuf::from(std::env::args().nth(1).unwrap());
    let results = mapper_reproduce::reproduce(|number| println!("figure {number}")).unwrap();
    for result in &results {
        let path = folder.join(mapper_reproduce::picture_path(result));
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, &result.svg).unwrap();
    }
    std::fs::write(folder.join("reproduction.md"), mapper_reproduce::markdown(&results)).unwrap();
}
