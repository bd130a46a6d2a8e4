// The lights of the scene's list, in its order.
// use shared/light/list

@group(3) @binding(0) var<storage, read> lights: array<ListLight>;
