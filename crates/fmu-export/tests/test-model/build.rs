//! Generates the typed interface and the modelDescription.xml of the model.

fn main() {
    fmi2_export::build::generate("model.json");
}
