"""How does the page on variants of recordings look?"""

from typing import TYPE_CHECKING, Any

from evidence.common import variants
from evidence.common.pages import fraction, picture, table
from evidence.common.running import Results
from motionary.plots.style import BLUE, ORANGE, RULE, TRUNK, VERMILLION, house_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: A variant is wrong if more of its known values differ for longer than a flip.
WRONG_FROM = 0.01

EQUAL, RIGHT, ALARM, SAID, WRONG = (
    "same", "error, rightly", "false alarm", "read with a warning", "silently wrong",
)  # fmt: skip
# Kinds in which relations are unknown that the recording knows, or the rest pose is seen, too.
_LACKING = (
    "legs alone", "no legs", "no legs, sides exchanged", "gaps", "kept in place",
    "lying still alone", "rest pose first",
)  # fmt: skip
#: From good to bad.
VERDICTS = (EQUAL, RIGHT, SAID, ALARM, WRONG)
_COLOURS = dict(zip(VERDICTS, (BLUE, TRUNK, RULE, ORANGE, VERMILLION), strict=True))


def write(results: Results) -> str:
    """Body of the page."""
    totals = results["totals"]
    rows = [
        [
            row["kind"],
            ", ".join(row["formats"]),
            *(row["verdicts"].get(verdict, 0) for verdict in VERDICTS),
            _percent(row["flips"]),
            _percent(row["most_flips"]),
            f"{row['labels_same']} of {row['labels']}" if row["labels"] else "–",
            row["labels_more"],
        ]
        for row in results["kinds"]
    ]
    head = ["variant", "formats", *VERDICTS, "flips, mean %", "most %", "labels same", "more"]
    return f"""
{results["variants"]} files, made of {results["sources"]} recordings: arithmetic that shares no code
with the readers changes a recording, the writers of the package write it (npz as NumPy writes
it), and, as these know one unit and axis each, the words of the file about them are changed
where the variant asks for it. Each file is read as its user would read it: nothing is told but
the rate of AMC files, which hold none, and the skeleton of half a body.

- *same*: relations are those of the recording. Values that differ for up to 0.1 s are threshold
  flips and counted; a variant is *silently wrong* if more than {fraction(WRONG_FROM)} of its known
  values differ for longer, and no word says so.
- *error, rightly*: what the file says contradicts the body, and reading it is refused.
- *read with a warning*: not the same, and a note says what is open: that the body does not tell
  left from right, that it lies or stands still, that the first frame is a rest pose, or that
  thighs stand in for arms as the measure.
- *false alarm*: refused, although nothing was wrong.

{table(head, rows)}
{picture("variants", "What became of each kind of variant in each format")}
Of {results["variants"]}: {totals[EQUAL]} same, {totals[RIGHT]} rightly refused, {totals[SAID]}
read with a warning, {totals[ALARM]} false alarms, {totals[WRONG]} silently wrong.
{_of_originals(results["originals"])}

Labels are those of the eleven classes of HDM05, learned from four actors, in recordings of the
fifth and in others; *labels same* begin and end within 0.1 s of those of the recording, *more*
are not there. {_of_labels(results["kinds"])}

## What no reader can tell

- A recording that is mirrored, places and names, is one of a person: its relations are those of
  the mirrored motion. That is right, and counts as same.
- Without legs only bent elbows tell left from right, and often they do not; a note says so.
- Who lies still from beginning to end has the shape of who stands along another axis. A BVH file
  of it is refused until `up=` is told; points are taken for standing, AMC for lying, and both say
  so. (The kind is cut out of one recording, so its alarms are one alarm in several files.)
- Without arms, lengths are measured in thighs that stand in for the upper arm. It is .71 of them
  on average, and not in everyone: a few relations near a threshold differ, and `info` warns.
- A rest pose before the motion stays, and is noted. Lengths are measured in the first frame, as
  published; of a rig whose bones have other lengths at rest they are those of the rest.
- An AMC file at another rate than 120 Hz that is not told is read at the wrong speed; the note
  `rate assumed 120 Hz` says so. Here the rate was told.

## What the variants changed in the package

- *Lowest joint*: without feet the lowest joint seen is not the lowest, and relations on it (F33,
  F34, F37) were wrong; now they are unknown.
- *In place*: not only F25, F26 and F39 are lost, but also F13 and F14: a hand that is fast because
  its body walks is slow on the spot.
- Thresholds of the checks were set on the same recordings, unchanged, with a wide margin; first
  runs of the variants found the faults above and shaped what counts as standing. So these counts
  are not those of recordings never seen.
{_list_of_alarms(results["alarms"])}
"""


def _of_labels(kinds: list[Results]) -> str:
    whole = [row for row in kinds if row["kind"] not in _LACKING]
    wanted, same, more = (
        sum(row[key] for row in whole) for key in ("labels", "labels_same", "labels_more")
    )
    in_place = next(row for row in kinds if row["kind"] == "kept in place")
    hops = sum(n for name, n in in_place["more"].items() if name.startswith("hop"))
    return (
        f"Where nothing is lacking, {same} of {wanted} labels are the same, and {more} more are "
        "found. Half a body has none of them: less than half of what a class asks for was seen, "
        "and the recording is reported as unassessed. In gaps a few come and go. Kept in place, "
        f"{in_place['labels_more']} more labels are found, {hops} of them hops: once speeds are "
        "unknown, who stands with closed legs may hop. Such labels say what share of what they "
        "ask for was known, and the recording's note says why; a class that rests on speed should "
        "not be sought in such clips."
    )


def _of_originals(found: Results) -> str:
    return (
        f"All {found['recordings']} recordings as they are were read without an alarm; of "
        f"{found['untold']} the body does not tell left from right, {found['in_place']} were "
        "taken for kept in place."
    )


def _list_of_alarms(alarms: list[Results]) -> str:
    if not alarms:
        return ""
    rows = [
        [row["kind"], row["format"], row["source"].split("/")[-1], row["verdict"]] for row in alarms
    ]
    return "\n## False alarms and worse, one by one\n\n" + table(
        ["variant", "format", "recording", "verdict"], rows
    )


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.2f}"


@house_style()
def draw(results: Results) -> "dict[str, Figure]":
    """A square per kind and format: the worst that happened there, and how often."""
    from matplotlib.figure import Figure

    kinds = results["kinds"]
    figure = Figure(figsize=(5.6, 0.2 * len(kinds) + 0.9), layout="constrained")
    axes = figure.subplots()
    for y, row in enumerate(kinds):
        for suffix, counts in row["formats"].items():
            worst = max(counts, key=VERDICTS.index)
            x = variants.ALL.index(suffix)
            axes.barh(y, 0.92, left=x - 0.46, height=0.86, color=_COLOURS[worst], linewidth=0)
            total = sum(counts.values())
            text = str(total) if counts[worst] == total else f"{counts[worst]} of {total}"
            axes.text(x, y + 0.03, text, ha="center", va="center", color="white", size=7)
    axes.set(xlim=(-0.5, len(variants.ALL) - 0.5), ylim=(len(kinds) - 0.5, -0.5))
    axes.set_yticks(range(len(kinds)), [row["kind"] for row in kinds])
    axes.set_xticks(range(len(variants.ALL)), [s.upper() for s in variants.ALL])
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    shown = [v for v in VERDICTS if results["totals"][v]]
    handles: list[Any] = [axes.barh(-9, 0, color=_COLOURS[v]) for v in shown]
    figure.legend(handles, shown, loc="outside lower left", ncols=3, frameon=False)
    return {"variants": figure}
