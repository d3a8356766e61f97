"""What a listener takes for a request, and what it refuses."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bench.stop.request import BadRequestError, request_in, response


def test_request_comes_in_pieces():
    whole = b"POST /stop?x=1 HTTP/1.1\r\nOrigin: http://a\r\ncontent-LENGTH: 11\r\n\r\ntoken=a%2Bb"
    assert all(request_in(whole[:count]) is None for count in range(len(whole)))
    found = request_in(whole + b"more")
    assert (found.method, found.path, found.origin, found.fields) == ("POST", "/stop", "http://a", {"token": "a+b"})


@pytest.mark.parametrize(
    ("said", "status"),
    [
        (b"\x16\x03\x01\x02\x00\r\n\r\n", 400),
        (b"GET / HTTP/2\r\n\r\n", 400),
        (b"POST /stop HTTP/1.1\r\nContent-Length: -1\r\n\r\n", 400),
        (b"POST /stop HTTP/1.1\r\nContent-Length: \xb2\r\n\r\n", 400),
        (b"POST /stop HTTP/1.1\r\nContent-Length: 1025\r\n\r\n", 413),
        (b"POST /stop HTTP/1.1\r\nContent-Length: " + b"9" * 5000 + b"\r\n\r\n", 413),
        (b"POST /stop HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n", 411),
        (b"POST /stop HTTP/1.1\r\nContent-Length: 2\r\n\r\n\xff\xfe", 400),
        (b"POST /stop HTTP/1.1\r\nContent-Length: 40\r\n\r\n" + b"a&" * 20, 400),
        (b"x" * 8193, 413),
    ],
)
def test_request_that_will_never_be_one_is_refused(said, status):
    with pytest.raises(BadRequestError) as refused:
        request_in(said)
    assert refused.value.status == status


BEGUN = (b"", b"POST /stop HTTP/1.1\r\n", b"POST / HTTP/1.1\r\nContent-Length:")


@given(st.binary(max_size=300), st.sampled_from(BEGUN))
def test_request_of_any_bytes_is_taken_refused_or_not_there_yet(said, begun):
    status = 0
    try:
        request_in(begun + said)
    except BadRequestError as error:
        status = error.status
    assert status in (0, 400, 411, 413)


def test_response_names_the_origin_that_may_read_it_and_no_other():
    assert b"\r\nAccess-Control-Allow-Origin: http://a\r\n" in response(200, {}, "http://a")
    assert b"Access-Control" not in response(200, {})
