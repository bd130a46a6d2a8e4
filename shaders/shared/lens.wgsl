// choice disk
// Rays of one position pass a disc and meet in the plane of focus.
// use shared/sampling

fn through_lens(line: Ray, one: PixelSample) -> Ray {
    let point = picture.lens_radius * uniform_disk(square(one, LENS));
    // Steps of a pixel are perpendicular to each other and of one length.
    let shift = (point.x / picture.pixel) * picture.right + (point.y / picture.pixel) * picture.down;
    // The direction has length one; along the view it gets on by its cosine.
    let way = line.direction * (picture.focus_distance / dot(line.direction, picture.forward));
    return endless(line.origin + shift, normalize(way - shift));
}

// choice pinhole
// All rays of a position are one.

fn through_lens(line: Ray, one: PixelSample) -> Ray {
    return line;
}
