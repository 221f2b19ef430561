//! Generates the typed interface and the modelDescription.xml from the declaration.

fn main() {
    fmi2_export::build::generate("controller.json");
}
