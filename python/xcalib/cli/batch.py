"""`xcalib batch`: many drives, many rigs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..frames import check_folder_writable
from .arguments import quiet_option, threads_option
from .errors import FAILED, NOT_TRUSTED, say, stop
from .options import Input, Output
from .workers_options import workers_options

if TYPE_CHECKING:
    from ..batch.run import DriveState


@click.command("batch", short_help="Calibrate, compare and register many drives.")
@click.argument("jobs", type=Input())
@click.option(
    "-o",
    "--output",
    metavar="DIR",
    type=Output(check_folder_writable, urls=True),
    required=True,
    help="Folder to write to, also behind a URL: one of each drive, summary.csv, summary.json and"
    " index.html.",
)
@click.option(
    "--dry-run", is_flag=True, help="Read the file, say what would be done, and do no more."
)
@click.option(
    "--overwrite",
    is_flag=True,
    help="Start over.  [default: what an earlier batch has done is kept]",
)
@workers_options
@threads_option
@quiet_option
def command(
    jobs: Path,
    output: Path | str,
    dry_run: bool,
    overwrite: bool,
    workers: int,
    scheduler: str | None,
    threads: int,
    quiet: bool,
) -> None:
    """Calibrate every drive of JOBS, compare it with its last rig, and register it.

    JOBS is a YAML file: `jobs`, a list of drives, and `defaults` for all of them. A drive has a
    name, reference, source, depth, and what else says which frames it has, by the names of the
    options; rig, the last one it was known to have; calibrate and register, options of these
    commands, or false.

    A rig that is not trusted registers nothing: the last one does, if there is one. Interrupted,
    the same command resumes.
    """
    from ..batch import open_workers
    from ..batch.jobs import load_jobs
    from ..batch.run import FAILED as GIVEN_UP
    from ..batch.run import GOOD, run_batch
    from ..batch.store import join, write
    from ..batch.summary import as_csv, as_json, as_page

    todo = load_jobs(jobs)
    if dry_run:
        for job in todo:
            calibrated = "calibrated" if job.calibrate is not None else f"by {job.rig}"
            done = "registered" if job.register is not None else "not registered"
            click.echo(f"{job.name}: {calibrated}, {done}, into {join(output, job.name)}")
        return

    def tell(state: DriveState) -> None:
        if not quiet:
            say(state.job.name, line_of(state))

    with open_workers(scheduler, workers) as several:
        states, is_new = run_batch(todo, output, several, threads, overwrite, tell)
    write(join(output, "summary.csv"), as_csv(states))
    write(join(output, "summary.json"), as_json(states))
    write(join(output, "index.html"), as_page(states, f"Batch of {jobs.name}"))
    good = sum(state.state == GOOD for state in states)
    nothing = "" if is_new else "nothing to do: "
    click.echo(f"{nothing}{good} of {len(states)} drives are good: {join(output, 'index.html')}")
    given_up = [
        state
        for state in states
        if state.state == GIVEN_UP or (state.registered is not None and state.registered.missing)
    ]
    for state in [*given_up, *states][:1]:
        if given_up or state.state != GOOD:
            code = FAILED if given_up else NOT_TRUSTED
            stop(code, f"{state.job.name}: {line_of(state)}")


def line_of(state: DriveState) -> str:
    """A drive in a line."""
    found, done = state.calibration, state.registered
    parts = [state.state]
    if found is not None and found["median_px"] is not None:
        parts.append(f"expected error {found['median_px']:.2g} px")
    if done is not None:
        parts.append(f"{done.earlier + done.made} of {done.frames} frames")
    return ", ".join(parts) + (f": {state.why}" if state.why else "")
