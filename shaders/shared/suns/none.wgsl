// No light shines from one direction.
// use shared/light/sample

fn sample_sun(choice: f32) -> LightSample {
    return no_light();
}
