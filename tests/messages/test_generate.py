"""The generator: same bytes every time, and a reason when mavgen refuses."""

import pytest

from messages.generate import DEFINITION, GENERATED, GenerationError, generate


def test_generating_again_gives_the_same_bytes(tmp_path, capfd):
    destination = tmp_path / "dialect.py"
    generate(destination=destination)
    assert destination.read_bytes() == GENERATED.read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["dialect.py"]
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("intact", "broken", "reason"),
    [
        pytest.param('type="uint64_t"', 'type="int65_t"', "int65_t", id="unknown type"),
        pytest.param('id="60200"', 'id="0"', "HEARTBEAT", id="id of another message"),
        pytest.param("</mavlink>", "", "pandion.xml", id="not XML"),
        pytest.param("common.xml</include>", "absent.xml</include>", "absent", id="no include"),
    ],
)
def test_a_refused_definition_says_why_and_leaves_the_module_alone(
    tmp_path, intact, broken, reason
):
    definition = tmp_path / "pandion.xml"
    definition.write_text(DEFINITION.read_text().replace(intact, broken))
    destination = tmp_path / "dialect.py"
    destination.write_text("as before")
    with pytest.raises(GenerationError, match=reason):
        generate(definition, destination)
    assert destination.read_text() == "as before"
