"""`planarm timing --html`: a recording with one late step and one missing, as a page in a real browser."""

import pytest

from captures import two_joints, write_vcd
from planarm.cli.main import main


@pytest.fixture(scope="module")
def judged(tmp_path_factory):
    """The page of a recording held against another: step 7 of joint 2 is missing, step 150 of joint 1 is 5 us late."""
    folder = tmp_path_factory.mktemp("timing")
    train = two_joints()
    late = train.joints[0][150].rise_ps + 5_000_000
    write_vcd(folder / "a.vcd", train)
    write_vcd(folder / "b.vcd", train.without(1, 7).changed(0, 150, rise_ps=late))
    with pytest.raises(SystemExit) as left:
        main(["timing", "diff", str(folder / "a.vcd"), str(folder / "b.vcd"), "--html", str(folder / "out.html")])
    assert left.value.code == 7
    return folder / "out.html", late / 1e12


@pytest.mark.parametrize("look", ["desktop", "dark", "phone"])
def test_it_reads_well_in_every_look(judged, opened, violations, look):
    page_file, _ = judged
    with opened(page_file.as_uri(), look) as page:
        assert page.told == []
        assert page.asked == [page_file.as_uri()]
        assert violations(page) == []
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "nothing is wider than the screen"


def test_each_finding_is_a_row_with_its_time_and_joint(judged, opened):
    page_file, late_s = judged
    with opened(page_file.as_uri()) as page:
        rows = [row.split("\t") for row in page.locator("[aria-label=findings] tbody tr").all_inner_texts()]
        found = {(row[1].strip(), row[2].strip()): float(row[0].removesuffix(" s")) for row in rows}
        assert set(found) == {("1", "step late"), ("2", "step missing")}
        assert found["1", "step late"] == pytest.approx(late_s, abs=1e-5)
        assert page.locator(".lanes .tick.bad").count() == 2
