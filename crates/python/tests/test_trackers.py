"""Cases of other libraries' trackers, each by its number: ours right, the peers' answers recorded."""

import sys
from pathlib import Path

import pytest

pytest.importorskip("trimesh")

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))

import missing_hits  # noqa: E402

# Rays with a wrong number of crossings, as measured with trimesh 5.2.0, embreex 4.4.0 and Open3D 0.20.0 on a processor with AVX-512: with
# embreex, with trimesh's own loop, with Open3D. Of so many rays: the last number.
TRACKERS = {
    "trimesh #242": [0, 0, 1450, 7680],
    "trimesh #457": [0, 0, 17, 1089],
    "trimesh #1180": [2, 0, 1544, 2562],
    "trimesh #1496": [0, 0, 0, 194],
    "trimesh #1766": [0, 0, 0, 63],
    "trimesh #1919": [58, 64, 478, 1024],
    "trimesh #2504": [0, 0, 33, 1089],
    "trimesh #2520": [256, 0, 0, 1123],
    "mitsuba3 #1149": [0, 0, 1450, 7680],
    "Embree #174": [2, 0, 1544, 2562],
    "Embree #181": [2, 0, 1544, 2562],
    "Embree #188": [0, 0, 1450, 7680],
}
PEERS = ["trimesh + embreex", "trimesh, own loop", "Open3D"]


def names(case):
    """The trackers of a case: `trimesh #1180, Embree #174, #181` are three."""
    project, found = "", []
    for part in case.trackers.split(", "):
        project, _, number = part.rpartition("#") if not part.startswith("#") else (project, "", part[1:])
        if number.isdigit():
            found.append(f"{project}#{number}")
    return found


CASES = {name: [case for case in missing_hits.cases() if name in names(case)] for name in TRACKERS}


@pytest.mark.parametrize("name", TRACKERS)
def test_the_case_of_a_tracker_has_no_wrong_answer(name, record_property):
    cases, (*recorded, n_rays) = CASES[name], TRACKERS[name]
    assert sum(len(case.origins) for case in cases) == n_rays
    engines = missing_hits.engines()
    assert sum(missing_hits.wrong(case, engines["canted"](case)) for case in cases) == 0
    for peer, expected in zip(PEERS, recorded):
        if peer in engines:
            # Not required: other versions and processors answer differently.
            record_property(peer, f"{sum(missing_hits.wrong(case, engines[peer](case)) for case in cases)}, recorded {expected}")


def test_every_case_has_a_number():
    assert {name for case in missing_hits.cases() for name in names(case)} == set(TRACKERS)
