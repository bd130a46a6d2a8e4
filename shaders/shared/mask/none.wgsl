// Every hit stands.

fn accepts(hit: Hit) -> bool {
    return true;
}
