"""The page that `make bench` writes, from what this session's benchmarks have found."""

import pytest
import report


def test_page_takes_what_the_benchmarks_found(request, measured, tmp_path):
    asked = {item.name for item in request.session.items if "benchmark" in item.fixturenames}
    if len(measured) < 15 or not asked <= measured.keys():
        pytest.skip("needs the other benchmarks in the same process")
    report.write(measured, {}, tmp_path)
    page = (tmp_path / "dev" / "performance.md").read_text(encoding="utf-8")
    for section in (
        "The whole case",
        "One NLP iteration",
        "Growth",
        "Many flows",
        "A year",
        "A wake with memory",
        "Sweeps",
        "Peers",
        "BEM alone",
    ):
        assert f"\n## {section}\n" in page
    assert (tmp_path / "images" / "growth.png").is_file()
