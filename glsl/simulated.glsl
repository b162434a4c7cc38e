// The grey of the simulated image at a place among the scanlines: bilinear in the log-compressed image, through the
// grey map. The includer declares log_image[] and grey[], and includes sector.glsl.

uint simulated_grey(Around a) {
    float near = mix(log_image[a.at.x], log_image[a.at.y], a.beyond.x);
    float far = mix(log_image[a.at.z], log_image[a.at.w], a.beyond.x);
    return grey[grey_level(mix(near, far, a.beyond.y))];
}
