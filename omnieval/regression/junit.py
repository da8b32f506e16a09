"""A check as JUnit XML, which continuous integration shows as tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from omnieval.regression.report import CaseReport, explanations, failure_line
from omnieval.results.atomic import replacing
from omnieval.wording import shown


def write_junit(reports: Sequence[CaseReport], path: Path) -> None:
    """Write one test suite a case and one test case a guarded value.

    Raises
    ------
    ResultError
        If the file cannot be written.
    """
    suites = [_suite(report) for report in reports]
    root = ET.Element("testsuites", name="omnieval check")
    for name in ("tests", "failures", "errors"):
        root.set(name, str(sum(int(suite.get(name, 0)) for suite in suites)))
    root.set("time", _seconds(sum(report.seconds or 0.0 for report in reports)))
    root.extend(suites)
    ET.indent(root)
    with replacing(path) as temporary:
        ET.ElementTree(root).write(temporary, encoding="utf-8", xml_declaration=True)


def _suite(report: CaseReport) -> ET.Element:
    """Return the suite of a case; what could not be replayed is an error, what is worse a failure."""
    name, seconds = shown(report.name), report.seconds or 0.0
    why = "\n".join(shown(line) for line in explanations(report))
    tests = len(report.outcomes) + (report.fault is not None)
    error = report.fault is not None and not report.worse
    failures = sum(outcome.failed for outcome in report.outcomes) + (report.fault is not None and report.worse)
    counts = {"tests": tests, "failures": failures, "errors": int(error)}
    suite = ET.Element("testsuite", {"name": name, **{key: str(value) for key, value in counts.items()}})
    suite.set("time", _seconds(seconds))
    each = _seconds(seconds / tests if tests else 0.0)
    if report.fault is not None:
        test = ET.SubElement(suite, "testcase", classname=name, name="replay", time=each)
        _add(test, "error" if error else "failure", report.fault, why)
    for outcome in report.outcomes:
        test = ET.SubElement(suite, "testcase", classname=name, name=outcome.metric, time=each)
        if outcome.failed:
            _add(test, "failure", failure_line(report.name, outcome), why)
    return suite


def _seconds(value: float) -> str:
    return f"{value:.3f}"


def _add(test: ET.Element, kind: str, message: str, why: str) -> None:
    ET.SubElement(test, kind, message=shown(message)).text = why
