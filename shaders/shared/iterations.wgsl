// Turns of loops that an invocation took: drivers may end loops early, and what counts them knows when.

var<private> iterations: u32;
