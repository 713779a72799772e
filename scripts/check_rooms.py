"""Check that the C++ core keeps to its rooms: `check_rooms.py [ROOT]`, exit 1 with a line a breach.

Each folder of ``cpp/src`` is a room and includes only rooms above it in ``ROOMS``; depth, judge and
footage do not include each other. A public header belongs to the room that has its source. No file
includes itself through others, Ceres stays in ``solve``, and nothing that `xcalib::register`
installs leads to a solver's header. Only ``geometry`` reads the coefficients of a camera, and what
prints, parses or parameterizes one: how a camera projects is written in one place.
"""

import re
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOMS = (
    "base",
    "images",
    "geometry",
    "register",
    "rig_file",
    "photometry",
    "objective",
    "solve",
    "calibrate",
    "depth",
    "judge",
    "footage",
    "stream",
)
APART = {"depth", "judge", "footage"}
# Public headers without a source of their own.
HEADERS_ONLY = {
    "xcalib/error.hpp": "base",
    "xcalib/export.hpp": "base",
    "xcalib/threads.hpp": "base",
    "xcalib/calibration_times.hpp": "objective",
    "xcalib.h": "register",
    "xcalib_rig_file.h": "rig_file",
}
UMBRELLA = "xcalib.hpp"
# Who reads a coefficient of a camera, by the path within cpp/ or its beginning.
READERS = (
    "src/geometry/",
    # parameterize
    "src/objective/paper_variables.cpp",
    "src/objective/parameters.cpp",
    "src/objective/projection_derivative.hpp",
    # print and parse
    "python/bind_camera.cpp",
    "src/footage/fingerprint.cpp",
    "src/judge/describe.cpp",
    "src/judge/documents.cpp",
    "src/register/c_api.cpp",
    "src/rig_file/",
)
COEFFICIENT = re.compile(r"(?:\.|->)(?:fx|fy|cx|cy|skew)\b")
REGISTER = ROOMS[: ROOMS.index("register") + 1]


def includes_of(path: Path) -> list[str]:
    """What a file includes, as written, without brackets or quotes."""
    return re.findall(r'^\s*#\s*include\s+["<]([^">]+)[">]', path.read_text(), re.MULTILINE)


def room_of(name: str, rooms_by_stem: dict[str, str]) -> str | None:
    """The room of a file by the name that includes give it; None for what is not of the core."""
    if name in HEADERS_ONLY:
        return HEADERS_ONLY[name]
    first = name.split("/")[0]
    if first in ROOMS:
        return first
    if first == "xcalib":
        return rooms_by_stem.get(Path(name).stem)
    return None


def breaches(root: Path) -> list[str]:
    """A line for each."""
    source, public = root / "cpp/src", root / "cpp/include"
    found = [
        f"cpp/src/{p.relative_to(source)}: in none of the rooms of {Path(__file__).name}"
        for p in sorted(source.rglob("*.?pp"))
        if p.relative_to(source).parts[0] not in ROOMS
    ]
    files = {str(p.relative_to(source)): p for p in sorted(source.rglob("*.?pp"))}
    rooms_by_stem = {p.stem: name.split("/")[0] for name, p in files.items() if p.suffix == ".cpp"}
    for p in sorted(public.rglob("*.h*")):
        files[str(p.relative_to(public))] = p
    graph = {}
    for name, path in files.items():
        included = includes_of(path)
        graph[name] = {other for other in included if other in files and other != name}
        if name == UMBRELLA:
            continue
        room = room_of(name, rooms_by_stem)
        if room is None:
            found.append(f"{name}: a public header without a room")
            continue
        for other in included:
            if re.match(r"ceres/", other) and room != "solve":
                found.append(f"{name}: includes <{other}>, which only solve may")
            if other not in files:
                continue
            below = room_of(other, rooms_by_stem)
            if other == UMBRELLA:
                found.append(f"{name}: includes {UMBRELLA}, which is for users")
            elif below is None or ROOMS.index(below) > ROOMS.index(room):
                found.append(f"{name}: {room} includes {other} of {below}, which stands below it")
            elif below != room and {below, room} <= APART:
                found.append(f"{name}: {room} includes {other} of {below}: these stand apart")
    cpp = root / "cpp"
    for path in sorted(cpp.rglob("*.?pp")):
        within = str(path.relative_to(cpp))
        if within.startswith(READERS):
            continue
        found += [
            f"cpp/{within}:{number}: reads a coefficient of a camera ({read.group()}): what is"
            " asked for belongs in cpp/src/geometry"
            for number, line in enumerate(path.read_text().splitlines(), 1)
            if (read := COEFFICIENT.search(line))
        ]
    try:
        order = list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        return [*found, "cycle: " + " -> ".join(error.args[1])]
    # All that each file leads to.
    leads_to: dict[str, set[str]] = {}
    for name in order:
        leads_to[name] = set(includes_of(files[name])) if name in files else set()
        for other in graph.get(name, ()):
            leads_to[name] |= leads_to[other]
    for name in files:
        if not (name.startswith("xcalib") and room_of(name, rooms_by_stem) in REGISTER):
            continue
        for other in sorted(leads_to[name]):
            room = room_of(other, rooms_by_stem)
            if other.startswith("ceres/") or (room and room not in REGISTER):
                found.append(f"{name}: of the register library, leads to {other}")
    return found


def main() -> None:
    """Print what was found."""
    found = breaches(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1])
    print("\n".join(found))
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
