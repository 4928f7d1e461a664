"""``swarmbid list``: what there is to choose from."""

from __future__ import annotations

from swarmbid.cli.plan import AsJson


def list_(as_json: AsJson = False) -> None:
    """List the algorithms, scores, scenarios, data sets, references and experiments, with one line each."""
    from swarmbid import registry
    from swarmbid.cli.output import say_json, say_table

    found = [
        {"kind": folder.removesuffix("s"), "name": name, "summary": registry.summary(folder, name)}
        for folder in registry.FOLDERS
        for name in registry.names(folder)
    ]
    if as_json:
        say_json(found)
    else:
        say_table(["kind", "name", "what it is"], [list(entry.values()) for entry in found], text=(0, 1, 2))
