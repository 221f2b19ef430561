//! Generates the typed interface and the modelDescription.xml of both models from their declarations.

fn main() {
    fmu_export_build::generate("modelDescription/plant.json");
    fmu_export_build::generate("modelDescription/controller.json");
}
