"""``omnieval doctor``: what is installed, and whether it works."""

from __future__ import annotations

from omnieval.cli import options


def doctor(json: options.Json = False) -> None:
    """Show versions, machine, cache and viewer, and test the installation on a small synthetic sequence.

    Made to be pasted into a bug report; the home folder is shown as ~. Exits with 1 if the self-test fails.

    Examples:

      omnieval doctor

      omnieval doctor --json > report.json
    """
    import dataclasses

    from omnieval.cli.console import print_fields, print_json
    from omnieval.doctor import examine, self_test
    from omnieval.errors import OmnievalError

    found = examine()
    if not json:
        for name, fields in found.sections.items():
            print(name)
            print_fields(fields.items())
        print("self-test", flush=True)  # what follows takes seconds
    tested = self_test()
    if json:
        print_json({"schema_version": 1, "ok": tested.ok, **found.sections, "self_test": dataclasses.asdict(tested)})
    else:
        print_fields((name, str(value)) for name, value in tested.facts.items())
        print("  ok" if tested.ok else f"  failed: {tested.failure}")
    if not tested.ok:
        raise OmnievalError(f"the self-test failed: {tested.failure}; report it with the output of omnieval doctor")
