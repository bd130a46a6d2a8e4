// choice disk
// A thin lens: rays through one pixel position converge in the focal plane.
// use shared/sampling

fn through_lens(line: Ray, one: PixelSample) -> Ray {
    let point = picture.lens_radius * uniform_disk(square(one, LENS));
    // The two pixel steps are perpendicular and equally long.
    let shift = (point.x / picture.pixel) * picture.right + (point.y / picture.pixel) * picture.down;
    // The direction is a unit vector; its progress along the view axis is its cosine.
    let delta = line.direction * (picture.focus_distance / dot(line.direction, picture.forward));
    return infinite_ray(line.origin + shift, normalize(delta - shift));
}

// choice pinhole
// A pinhole.

fn through_lens(line: Ray, one: PixelSample) -> Ray {
    return line;
}
