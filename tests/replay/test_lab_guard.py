"""Only the lab's own pages, authorised by its token, change anything; foreign requests of every form are refused."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

pytest.importorskip("uvicorn", reason="the lab's packages are not installed")

from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from straw.replay.errors import ReplayError
from straw.replay.lab.guard import Door
from straw.replay.lab.serve import bound
from tests.replay.lab import ServedLab

ARM = '{"who": "x", "on": true}'


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedLab]:
    with ServedLab(tmp_path_factory.mktemp("lab"), emulate=True) as served:
        served.lab.bench.control.heard("x", "x")
        yield served


def test_its_own_page_is_allowed(lab: ServedLab) -> None:
    assert lab.raw("POST", "/api/vent", body="{}")[0] == 200


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"Host": "evil.example:80"}, 421),  # DNS rebinding
        ({"Host": "evil.example:{port}", "Origin": "http://evil.example:{port}"}, 421),  # and a matching origin
        ({"Host": "127.0.0.1"}, 421),
        ({"Host": "127.0.0.1:x"}, 421),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "http://127.0.0.1:1"}, 403),  # another server of this machine: the same site, so cookies are sent
        ({"Origin": "https://127.0.0.1:{port}"}, 403),
        ({"Origin": "null"}, 403),
        ({"Sec-Fetch-Site": "cross-site"}, 403),
        ({"Sec-Fetch-Site": "same-site"}, 403),
        ({"Cookie": ""}, 403),
        ({"Cookie": "straw-{port}=guess"}, 403),
        ({"Content-Type": "text/plain"}, 415),
        ({"Content-Type": "application/x-www-form-urlencoded"}, 415),
        ({"X-Straw": None}, 403),
    ],
)
@pytest.mark.parametrize("action", ["arm", "vent", "queue", "say"])
def test_a_foreign_request_is_refused_before_anything_reads_it(
    lab: ServedLab, change: dict[str, str | None], status: int, action: str
) -> None:
    headers = {**lab.own, **{k: v.replace("{port}", str(lab.door.port)) for k, v in change.items() if v is not None}}
    headers = {name: value for name, value in headers.items() if change.get(name, "") is not None}
    before = list(lab.lab.bench.said)
    assert lab.raw("POST", f"/api/{action}", headers, ARM)[0] == status
    assert not lab.lab.bench.armed
    assert lab.lab.bench.said == before


def test_no_get_request_changes_anything(lab: ServedLab) -> None:
    for action in ("arm", "start", "vent", "order", "queue", "control", "say", "recover", "job", "predict"):
        assert lab.raw("GET", f"/api/{action}?who=x&on=true")[0] in (400, 404, 405)
    assert not lab.lab.bench.armed


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:1", "null", None])
def test_a_foreign_socket_is_refused(lab: ServedLab, origin: str | None) -> None:
    headers = {"Cookie": f"{lab.door.cookie}={lab.door.token}"}
    with (
        pytest.raises(InvalidStatus),
        connect(f"ws://127.0.0.1:{lab.door.port}/ws", origin=origin, additional_headers=headers),
    ):
        pass


def test_a_socket_without_the_cookie_is_refused(lab: ServedLab) -> None:
    own = f"http://127.0.0.1:{lab.door.port}"
    with pytest.raises(InvalidStatus), connect(f"ws://127.0.0.1:{lab.door.port}/ws", origin=own):
        pass


def test_the_token_in_the_address_becomes_a_cookie_that_no_script_and_no_other_site_can_read(lab: ServedLab) -> None:
    import http.client

    asking = http.client.HTTPConnection("127.0.0.1", lab.door.port, timeout=10)
    asking.request("GET", f"/panel?token={lab.door.token}&x=1")
    answer = asking.getresponse()
    cookie = answer.headers["set-cookie"].lower()
    assert (answer.status, answer.headers["location"]) == (303, "/panel?x=1")  # the token leaves the address
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    asking.close()
    assert lab.raw("GET", "/?token=guess", {"Host": f"127.0.0.1:{lab.door.port}"})[0] == 403


def test_nothing_listens_beyond_this_machine_unless_requested() -> None:
    with pytest.raises(ReplayError, match="--remote"):
        bound("0.0.0.0:0", elsewhere=False)
    listener, host, port = bound("127.0.0.1:0", elsewhere=False)
    listener.close()
    assert Door(host, port).knows("localhost")
    assert not Door(host, port).knows("192.168.1.7")  # a server that listens on this machine only never sees it
    far = Door("0.0.0.0", port)
    assert far.knows("192.168.1.7")
    assert not far.knows("evil.example")
