"""To every reader of the mcap package, files of this project's MCAP writer equal those of the package's own writer."""

import random
from io import BytesIO
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.records import Chunk, MessageIndex
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from straw.rig.mcap_write import McapWriter


def written() -> tuple[bytes, bytes]:
    """The same schemas, channels, messages, metadata and attachments, written by this project and by the package."""
    noise = random.Random(1)
    ours_stream, theirs_stream = BytesIO(), BytesIO()
    ours = McapWriter(ours_stream, "straw", "test")
    theirs = Writer(theirs_stream, enable_data_crcs=True)
    theirs.start("straw", "test")
    ours.add_metadata("first", {"a": "1", "ö": "é"})
    theirs.add_metadata("first", {"a": "1", "ö": "é"})
    ours.add_attachment(7, "protocol.toml", "text/plain", b"name")
    theirs.add_attachment(7, 7, "protocol.toml", "text/plain", b"name")
    for topic in ("/a", "/b"):
        assert ours.add_schema(f"s{topic}", "protobuf", b"xyz") == theirs.register_schema(
            f"s{topic}", "protobuf", b"xyz"
        )
    for topic, schema_id in (("/a", 1), ("/b", 2), ("/c", 0), ("/never", 1)):
        number = ours.add_channel(topic, "protobuf", schema_id, {"unit": "Pa"})
        assert number == theirs.register_channel(topic, "protobuf", schema_id, {"unit": "Pa"})
    for k in range(3000):
        data = noise.randbytes(noise.choice((0, 10, 2000)))  # 2 MB in all, so that some chunks are full
        log_ns = 10**18 + k * 1000 + noise.randrange(5000)  # not in order
        channel = noise.choice((1, 1, 1, 2, 3))
        ours.add_message(channel, log_ns, log_ns - 5, data)
        theirs.add_message(channel, log_ns, data, log_ns - 5)
        if k % 700 == 0:
            ours.flush()
            theirs.flush()
    ours.finish()
    theirs.finish()
    return ours_stream.getvalue(), theirs_stream.getvalue()


@pytest.fixture(scope="module")
def readers() -> tuple[Any, Any]:
    ours, theirs = written()
    return make_reader(BytesIO(ours), validate_crcs=True), make_reader(BytesIO(theirs), validate_crcs=True)


@pytest.mark.parametrize(
    "wanted",
    [
        {},
        {"reverse": True},
        {"log_time_order": False},
        {"topics": ["/b", "/c"], "starting_at": 10**18 + 500_000, "ending_before": 10**18 + 1_700_000},
    ],
)
def test_an_indexed_reader_finds_the_same_messages(readers: tuple[Any, Any], wanted: dict[str, Any]) -> None:
    ours, theirs = (list(reader.iter_messages(**wanted)) for reader in readers)
    assert len(ours) > 100
    assert ours == theirs


def test_statistics_metadata_and_attachments_are_the_same(readers: tuple[Any, Any]) -> None:
    ours, theirs = (reader.get_summary() for reader in readers)
    assert ours.statistics == theirs.statistics
    assert (ours.schemas, ours.channels) == (theirs.schemas, theirs.channels)
    for mine, other in zip(ours.chunk_indexes, theirs.chunk_indexes, strict=True):
        for name in ("message_start_time", "message_end_time", "uncompressed_size", "compression"):
            assert getattr(mine, name) == getattr(other, name)
        assert list(mine.message_index_offsets) == list(other.message_index_offsets)
    for read in ("iter_metadata", "iter_attachments"):
        mine, other = (list(getattr(reader, read)()) for reader in readers)
        assert len(mine) == 1
        assert mine == other
    assert readers[0].get_header() == readers[1].get_header()


def test_every_checksum_is_valid_and_all_records_but_for_their_compression_are_the_same() -> None:
    ours, theirs = (
        list(StreamReader(BytesIO(data), emit_chunks=True, validate_crcs=True).records) for data in written()
    )
    for mine, other in zip(ours, theirs, strict=True):
        assert type(mine) is type(other)
        if isinstance(mine, Chunk):
            assert mine.uncompressed_crc == other.uncompressed_crc
        elif isinstance(mine, MessageIndex):
            assert mine == other


def test_a_file_without_messages_is_valid() -> None:
    stream = BytesIO()
    McapWriter(stream, "straw", "test").finish()
    stream.seek(0)
    summary = make_reader(stream, validate_crcs=True).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert (summary.statistics.message_count, summary.chunk_indexes) == (0, [])
