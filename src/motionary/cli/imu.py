"""`motionary imu`: tracked motion held against inertial sensors, and orientations from them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.options import (
    REQUIRED,
    AsJson,
    Excel,
    Force,
    check_picture,
    check_target,
    flag,
    option,
)
from motionary.cli.recordings import read_recording
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.inertial import LimbCheck, TrackingCheck

_COLUMNS = (
    "sensor", "limb", ">median", ">95 %", ">across", ">about", ">sure to", ">drift", ">wrong_s", "",
)  # fmt: skip

Columns = Annotated[
    str | None,
    typer.Option(
        "--columns", metavar="TOML", help="Columns, units and rate of tables of no known layout."
    ),
]


def imu() -> None:
    """Hold tracked motion against inertial sensors.

    Sensors: Xsens MTw (.txt) and MVNX, OpenSense (.sto), APDM and BROAD (.h5), Movella DOT and
    other tables (.csv, with --columns).

    motionary imu check take.bvh --imu sensors/
    motionary imu orient sensors/ -o orientations.sto
    """


@dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """Which sensors, where they sit, and where results go."""

    sensors: str = option("--imu PATH", "A folder or file of the sensors.", REQUIRED)
    limbs: str | None = option(
        "--map TOML", 'Limb of each sensor, "00B40C45" = "lthigh"; else found.'
    )
    columns: Columns = None
    fused: bool = flag(
        "--fused/--no-fused", "Take the orientations that the files bring, if they do."
    )
    magnetic: bool = flag(
        "--magnetic/--no-magnetic", "Let magnetometers tell headings; floors disturb them."
    )
    output: str | None = option("--output -o CSV", "Write the table of limbs, too.")
    labels: str | None = option(
        "--labels FILE", "Write the wrong segments as labels, in any format."
    )
    plot: str | None = option("--plot PNG", "Draw the angles over time.")
    excel: Excel = False
    force: Force = False


def check(
    motion: Annotated[str, typer.Argument(metavar="RECORDING", help="The motion as tracked.")],
    options: CheckOptions,
    as_json: AsJson = False,
    *,
    reading: ReadOptions,
) -> int:
    """List where limbs are tracked wrongly, by sensors that were worn.

    No calibration pose and no map is needed: clocks, limbs, mounts and headings are found. Angles
    are in degrees: between limb and sensor, across the limb and about it, and the expected error
    of the calibration ("sure to"). Positions cannot be checked so, only how limbs point and turn.

    motionary imu check take.bvh --imu sensors/ --plot angles.png --labels wrong.csv
    """
    from motionary.inertial import CheckSettings, check_tracking
    from motionary.io.labels import write_labels
    from motionary.io.sensors import read_sensors
    from motionary.io.text import write_table

    check_picture("--plot", options.plot)
    for target in (options.output, options.labels):
        check_target(target, replace=options.force)
    limbs = _read_map(options.limbs) if options.limbs is not None else None
    tracked = read_recording(Path(motion), reading)
    sensors = read_sensors(options.sensors, columns=options.columns)
    found = check_tracking(
        tracked,
        sensors,
        limbs=limbs,
        settings=CheckSettings(fused=options.fused, magnetic=options.magnetic),
    )
    rows = [_to_row(one, found) for one in found.limbs]
    if options.output is not None:
        columns = [key for key in rows[0] if key != "wrong"]
        table = [[row[key] for key in columns] for row in rows]
        write_table([columns, *table], options.output, excel=options.excel)
    if options.labels is not None:
        write_labels([found.track], options.labels)
    if options.plot is not None:
        from motionary.plots import plot_check, save

        save(plot_check(found), options.plot)
    if as_json:
        for row in rows:
            screen.print_json(row)
    else:
        _show(found, rows)
    for note in (*found.notes, *(note for sensor in sensors for note in sensor.notes)):
        screen.warn(note)
    return 0


def orient(
    source: Annotated[str, typer.Argument(metavar="PATH", help="A folder or file of sensors.")],
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="STO", help="Orientations, for OpenSense.")
    ],
    columns: Columns = None,
    magnetic: Annotated[
        bool, typer.Option(help="Let magnetometers tell headings; floors disturb them.")
    ] = False,
    force: Force = False,
) -> int:
    """Write orientations of sensors from their raw measurements.

    motionary imu orient sensors/ -o orientations.sto
    """
    from motionary.inertial import orient as orient_sensor
    from motionary.io.sensors import read_sensors, write_orientations

    check_target(output, replace=force)
    sensors = read_sensors(source, columns=columns)
    write_orientations(
        output,
        {one.name: orient_sensor(one, magnetic=magnetic) for one in sensors},
        sensors[0].rate_hz,
    )
    screen.say(f"{len(sensors)} sensors written to {output}")
    return 0


def _read_map(path: str) -> dict[str, str]:
    from motionary.io.text import read_toml

    limbs = read_toml(Path(path))
    wrong = [name for name, limb in limbs.items() if not isinstance(limb, str)]
    if wrong or not limbs:
        raise InvalidInput(
            f'needs lines such as "00B40C45" = "lthigh", got {wrong[0] if wrong else "none"}',
            file=Path(path).name,
        )
    return limbs


def _to_row(one: "LimbCheck", found: "TrackingCheck") -> dict[str, Any]:
    """What is said of one sensor, for JSON and tables."""
    import numpy as np

    rate = found.track.recording.rate_hz

    def summed(values: Any, how: Any) -> float | None:
        known = None if values is None else values[~np.isnan(values)]
        return None if known is None or not len(known) else round(float(how(known)), 2)

    def rms(values: Any) -> float:
        return float(np.sqrt(np.mean(values**2)))

    def finite(value: float) -> float | None:
        return round(value, 2) if np.isfinite(value) else None

    return {
        "recording": found.track.recording.name,
        "sensor": one.sensor,
        "limb": one.limb or None,
        "median_deg": summed(one.residual_deg, np.median),
        "p95_deg": summed(one.residual_deg, lambda known: np.percentile(known, 95)),
        "swing_deg": summed(one.swing_deg, rms),
        "twist_deg": summed(one.twist_deg, rms),
        "deviation_deg": finite(one.deviation_deg),
        "heading_deg": finite(one.heading_deg),
        "drift_deg": finite(one.drift_deg),
        "margin": finite(one.margin),
        "lag_s": round(found.lag.offset_s, 4),
        "wrong_s": round(sum(stop - first for first, stop in one.wrong) / rate, 2),
        "wrong": [[round(a / rate, 3), round(b / rate, 3)] for a, b in one.wrong],
        "notes": "; ".join(one.notes),
    }


def _show(found: "TrackingCheck", rows: list[dict[str, Any]]) -> None:
    keys = ("sensor", "limb", "median_deg", "p95_deg", "swing_deg", "twist_deg", "deviation_deg",
            "drift_deg", "wrong_s", "notes")  # fmt: skip
    screen.print_table(_COLUMNS, [tuple(_cell(row, key) for key in keys) for row in rows])
    lag = found.lag
    drift = f", drift {lag.drift * 1e6:.0f} ppm" if lag.drift else ""
    screen.say(f"sensors' clock: motion's + {lag.offset_s:.3f} s{drift} (agreement {lag.peak:.2f})")
    for label in found.track:
        screen.say(
            f"{label.name}: {label.start_s:.2f} to {label.end_s:.2f} s, up to "
            f"{label.extra['worst_deg']} degrees in {label.extra['kind']} ({label.extra['sensor']})"
        )
    if not len(found.track):
        screen.say("no segment is tracked wrongly, as far as the sensors tell")


def _cell(row: Mapping[str, Any], key: str) -> str:
    value = row[key]
    if value is None:
        return "-"
    return f"{value:.1f}" if isinstance(value, float) else str(value)


SUBCOMMANDS = {"check": check, "orient": orient}
