fn main() {
    fmu_export_build::generate("model.json");
}
