// What objects make of one edge: `occupancy/coupling.rs` and `occupancy/parallel.rs` of the core in single precision.

// What is left of an edge: what couples its ends, and links from its ends to objects.
struct Coupling { through: f32, factor: vec2<f32>, object: vec2<u32> }

const UNLINKED: vec2<u32> = vec2<u32>(NO_OBJECT, NO_OBJECT);
const PLAIN: Coupling = Coupling(1.0, vec2<f32>(0.0), UNLINKED);

fn only_through(through: f32) -> Coupling { return Coupling(through, vec2<f32>(0.0), UNLINKED); }

alias Spans = array<Span, OBJECTS>;

fn spans_between(spans: ptr<function, Spans>, a: Spot, b: Spot) {
    for (var object = 0u; object < object_count(); object++) { (*spans)[object] = object_span(object, a, b); }
}

// A conductor that is met first when coming from one end, and where.
struct Met { object: u32, at: f32 }

fn met_from(spans: ptr<function, Spans>, owners: vec2<u32>, end: u32) -> Met {
    if (owners[end] != NO_OBJECT) { return Met(owners[end], f32(end)); }
    var met = Met(NO_OBJECT, 0.0);
    for (var object = 0u; object < object_count(); object++) {
        let span = (*spans)[object];
        if (!is_met(span) || !is_conductor(object)) { continue; }
        let place = select(span.enter, span.leave, end == 1u);
        let is_nearer = select((place < met.at), (place > met.at), end == 1u);
        if (met.object == NO_OBJECT || is_nearer) { met = Met(object, place); }
    }
    // An end that a conductor holds is a contact even where rounding misses it.
    if (met.object == NO_OBJECT) {
        let held = select(owners.x, owners.y, owners.x == NO_OBJECT);
        met = Met(held, 1.0 - f32(end));
    }
    return met;
}

// ∫ ε_background/ε dt from a to b: of dielectrics that overlap, the first listed counts.
fn series(spans: ptr<function, Spans>, background: f32, a: f32, end: f32) -> f32 {
    let b = max(end, a + SMALLEST_PART);
    var sum = 0.0;
    var begin = a;
    // Each piece ends where a span begins or ends.
    for (var piece = 0u; piece < 2u * object_count() + 1u && begin < b; piece++) {
        var to = b;
        for (var object = 0u; object < object_count(); object++) {
            let span = (*spans)[object];
            if (is_conductor(object) || !is_met(span)) { continue; }
            if (span.enter > begin) { to = min(to, span.enter); }
            if (span.leave > begin) { to = min(to, span.leave); }
        }
        let middle = 0.5 * (begin + to);
        var ratio = 1.0;
        for (var object = 0u; object < object_count(); object++) {
            let span = (*spans)[object];
            if (is_conductor(object) || !is_met(span)) { continue; }
            if (span.enter <= middle && middle <= span.leave) {
                ratio = permittivity_of(object) / background;
                break;
            }
        }
        sum += (to - begin) / ratio;
        begin = to;
    }
    return sum;
}

fn edge_rule(spans: ptr<function, Spans>, owners: vec2<u32>, background: f32) -> Coupling {
    let begin = met_from(spans, owners, 0u);
    let end = met_from(spans, owners, 1u);
    if (begin.object == NO_OBJECT || end.object == NO_OBJECT) {
        return only_through(1.0 / series(spans, background, 0.0, 1.0));
    }
    let holds = owners != UNLINKED;
    if (holds.x && holds.y) {
        if (owners.x == owners.y) { return PLAIN; }
        let own = (*spans)[owners.x];
        let other = (*spans)[owners.y];
        let a = select(0.0, own.leave, is_met(own));
        let b = select(1.0, other.enter, is_met(other));
        return only_through(1.0 / series(spans, background, a, b));
    }
    if (holds.x && end.object == owners.x) { return only_through(1.0 / series(spans, background, end.at, 1.0)); }
    if (holds.y && begin.object == owners.y) { return only_through(1.0 / series(spans, background, 0.0, begin.at)); }
    var coupling = only_through(0.0);
    if (!holds.x) {
        coupling.object.x = begin.object;
        coupling.factor.x = 1.0 / series(spans, background, 0.0, begin.at);
    }
    if (!holds.y) {
        coupling.object.y = end.object;
        coupling.factor.y = 1.0 / series(spans, background, end.at, 1.0);
    }
    return coupling;
}
