"""Every knob of lacuna with its unit, range and default, in one place.

Units are in the names: ``_m``, ``_deg``, ``_m_s``, ``_s``.  Angles are degrees here because people write this file;
radians begin where the program reads it.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

Quantity = Literal["heading", "depth", "altitude", "odometry"]
FeedDriver = Literal["nmea", "mavlink", "videoray_pro3", "videoray_pro4", "pressure"]

FRESH_WATER_KG_M3 = 997.0
SEA_WATER_KG_M3 = 1025.0
STANDARD_GRAVITY_M_S2 = 9.80665

BAUDS: Final[dict[str, int]] = {
    "nmea": 4800,
    "mavlink": 57600,
    "videoray_pro3": 9600,
    "videoray_pro4": 115200,
    "pressure": 9600,
}
"""What devices of each feed driver usually speak at."""


class Section(BaseModel):
    """A part of the configuration: unknown keys are refused, values are frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Site(Section):
    """Where the dive is."""

    name: str = Field("site", pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", description="used in file names")
    water: Literal["fresh", "sea"] | Annotated[float, Field(ge=900, le=1300)] = Field(
        "fresh", description="fresh, sea, or a density in kg/m3"
    )
    height_m: float | None = Field(None, gt=0, le=100, description="floor to ceiling; absent: from the depths seen")
    declination_deg: float = Field(0.0, ge=-180, le=180, description="added to magnetic headings, east positive")
    gravity_m_s2: float | None = Field(None, ge=9.7, le=9.9, description="absent: from latitude_deg, else 9.80665")
    latitude_deg: float | None = Field(None, ge=-90, le=90)
    temperature_c: float | None = Field(None, ge=0, le=35, description="of the water; sets the speed of sound")
    salinity_ppt: float | None = Field(None, ge=0, le=45, description="absent: 0 in fresh water, else 35")

    @property
    def density_kg_m3(self) -> float:
        """Density of the water in kg/m3."""
        if isinstance(self.water, float):
            return self.water
        return SEA_WATER_KG_M3 if self.water == "sea" else FRESH_WATER_KG_M3


class Sonar(Section):
    """The scanning sonar and how its head is set."""

    driver: Literal["tritech"] = "tritech"
    port: str = Field("/dev/ttyUSB0", min_length=1, description="any pyserial URL")
    baud: int = Field(115200, ge=1200, le=4_000_000)
    range_m: float = Field(10.0, ge=0.3, le=300)
    bins: int = Field(400, ge=50, le=800, description="echo bins per ping")
    step_deg: float = Field(1.8, ge=0.225, le=7.2, description="rounded to 1/16 gradian")
    bits: Literal[4, 8] = Field(8, description="to an echo; 4 halve the time on the line and coarsen the echoes")
    gain_pct: float = Field(50.0, ge=0, le=100)
    sound_speed_m_s: float = Field(1481.0, ge=1350, le=1650)
    head_type: Literal["dst", "non-dst"] = "dst"
    dual_channel: bool = Field(False, description="the head has two frequencies: set it with the gains of both")
    channel: Literal["low", "high"] = Field("low", description="which frequency of a head that has two")
    node: int = Field(2, ge=1, le=254)
    sector_deg: tuple[float, float] | None = Field(
        None, description="left and right limit, clockwise from the bow; absent: full circle"
    )
    mount_deg: float = Field(0.0, ge=-180, le=180, description="head's ahead, clockwise from the bow")
    inverted: bool = Field(False, description="the head hangs upside down")


def _usual_baud(known: dict[str, Any]) -> int:
    return BAUDS.get(known.get("driver", ""), BAUDS["nmea"])


def _usual_quantities(known: dict[str, Any]) -> tuple[Quantity, ...]:
    return ("depth",) if known.get("driver") == "pressure" else ("heading", "depth")


class Feed(Section):
    """A line that tells heading, depth, altitude or odometry.  Keys that only some drivers heed say which."""

    name: str = Field("feed", pattern=r"^[a-z][a-z0-9_-]{0,31}$")
    driver: FeedDriver = "nmea"
    port: str = Field("/dev/ttyUSB1", min_length=1, description="any pyserial URL, or udp://ADDRESS:PORT to listen at")
    baud: int = Field(
        default_factory=_usual_baud, ge=300, le=4_000_000, description="absent: what the driver's devices usually speak"
    )
    provides: tuple[Quantity, ...] = Field(
        default_factory=_usual_quantities, description="absent: depth with pressure, else heading and depth"
    )
    latency_ms: float = Field(0.0, ge=0, le=5000, description="age of a measurement when its first byte is sent")
    stale_after_s: float = Field(2.0, gt=0, le=3600, description="health calls older readings stale")

    heading_reference: Literal["as_said", "magnetic", "true"] = Field(
        "as_said", description="north of the headings: what the device says, or what the operator knows better"
    )
    mount_deg: float = Field(0.0, ge=-180, le=180, description="the compass's ahead, clockwise from the bow")
    deviation_deg: tuple[tuple[float, float], ...] = Field(
        (), max_length=72, description="pairs of a magnetic heading as read and what to add to it; turned between"
    )
    field_strength: float | None = Field(
        None, gt=0, le=1e6, description="undisturbed magnetic field, in the compass's own unit"
    )
    field_tolerance_pct: float = Field(10.0, gt=0, le=100)
    max_turn_deg_s: float = Field(180.0, gt=0, le=3600, description="faster turns are jumps of the compass")

    depth_offset_m: float = Field(0.0, ge=-100, le=100, description="added to depths: how far the sonar is below")
    surface_mbar: float | None = Field(
        None, ge=500, le=1200, description="absolute pressure at the surface; absent: 1013.25 until a tare"
    )
    max_dive_m_s: float = Field(3.0, gt=0, le=100, description="faster dives are jumps of the depth")
    odometry_sd_pct: float = Field(3.0, gt=0, le=100, description="error of odometry, in percent of the way")
    max_speed_m_s: float = Field(3.0, gt=0, le=100, description="faster odometry is a jump")
    max_climb_m_s: float = Field(5.0, gt=0, le=100, description="faster changes are jumps of the altitude")

    checksum: Literal["require", "warn", "ignore"] = Field("require", description="nmea")
    dpt: Literal["vehicle_depth", "altitude"] = Field(
        "vehicle_depth", description="nmea: what DPT and DBT sentences mean"
    )
    talker: str | None = Field(None, pattern=r"^[A-Z]{2}$", description="nmea: of standard sentences; absent: any")
    variation: Literal["sentence", "site"] = Field(
        "sentence", description="nmea: a variation in HDG goes before the site's declination, or is left alone"
    )
    angle_unit: Literal["auto", "deg", "tenth_deg", "bam16", "mil"] = Field(
        "auto", description="nmea of compass makers: auto, deg, bam16, mil; videoray_pro4: auto, deg, tenth_deg"
    )
    xdr_depth_names: tuple[str, ...] = Field(("DEPTH", "DPTH"), description="nmea: transducers that tell the depth")
    xdr_pressure_names: tuple[str, ...] = Field((), description="nmea: transducers that tell the water's pressure")

    system: int | None = Field(
        None, ge=1, le=255, description="mavlink: the vehicle; absent: the first autopilot heard"
    )
    heading_from: Literal["attitude", "vfr_hud"] = Field("attitude", description="mavlink")
    pressure_message: Literal[1, 2, 3] = Field(2, description="mavlink: SCALED_PRESSURE, or its 2 or 3, is the water's")

    depth_points: tuple[tuple[float, float], tuple[float, float]] | None = Field(
        None, description="videoray_pro3: two pairs of raw count and depth in m; no default is safe"
    )
    poll: bool = Field(False, description="videoray_pro4, pressure (keller): ask for data; one program may on a line")
    poll_hz: float = Field(5.0, gt=0, le=10)
    crc32: bool = Field(False, description="videoray_pro4, polled: the vehicle is one that checks packets by CRC-32")

    format: Literal["text", "keller"] = Field("text", description="pressure: lines of text, or Keller's bus")
    column: int = Field(1, ge=1, le=64, description="pressure (text): the number that counts, from 1")
    unit: Literal["mbar", "hpa", "bar", "dbar", "kpa", "pa", "psi", "m", "ft"] = Field(
        "mbar", description="pressure (text): m and ft are depths"
    )
    pressure: Literal["absolute", "gauge"] = Field("absolute", description="nmea (XDR), pressure: gauge is 0 in air")
    address: int = Field(250, ge=1, le=250, description="pressure (keller): 250 is any single sensor")
    channel: int = Field(1, ge=0, le=2, description="pressure (keller): 0 calculated, 1 P1, 2 P2")
    whole_pascals: bool = Field(False, description="pressure (keller), polled: ask in whole pascals (function 74)")


class Map(Section):
    """Scans, registration and the evidence grid."""

    cell_m: float = Field(0.05, ge=0.02, le=0.25)
    occupied_threshold: float = Field(0.75, ge=0.5, le=0.95, description="the paper's t, 0.65 to 0.85")
    free_threshold: float = Field(0.35, ge=0.05, le=0.5)
    beam_deg: float = Field(3.0, gt=0, le=20, description="horizontal width of the beam")
    beam_vertical_deg: float = Field(35.0, gt=0, le=90, description="vertical width of the beam")
    range_offset_m: float = Field(0.0, ge=-0.5, le=0.5, description="added to every range")
    min_range_m: float = Field(0.3, ge=0, le=5)
    particles: int = Field(1000, ge=50, le=20_000)
    compass_sd_deg: float = Field(4.0, gt=0, le=45)
    reach_m: float = Field(3.0, gt=0, le=20, description="how far a pilot moves between two stations")
    heading_deg: float | None = Field(None, ge=0, lt=360, description="a constant heading, where no feed tells one")
    seed: int = Field(1, ge=0)


class Fill(Section):
    """Filling of holes."""

    method: Literal["chord", "paper"] = "chord"
    max_gap_m: float = Field(2.0, gt=0, le=20)
    seed: int = Field(1, ge=0)


class Publish(Section):
    """What listens, and where."""

    bind: str = Field("tcp://127.0.0.1", pattern=r"^tcp://\S+$", description="address without port")
    port: int = Field(5556, ge=1, le=65535, description="snapshots")
    request_port: int = Field(5557, ge=1, le=65535)
    keys: str | None = Field(None, description="folder of CURVE keys; needed for any address but loopback")


class Recording(Section):
    """Where logs go."""

    folder: str = Field("logs", min_length=1)
    segment_mib: float = Field(64.0, gt=0, le=4096)
    segment_min: float = Field(10.0, gt=0, le=1440)
    disk_low_mib: float = Field(500.0, ge=0, description="free space below which health warns")


class Config(Section):
    """The whole configuration, as read from TOML and as kept in every log."""

    site: Site = Site()
    sonar: Sonar = Sonar()
    feed: tuple[Feed, ...] = ()
    map: Map = Map()
    fill: Fill = Fill()
    publish: Publish = Publish()
    recording: Recording = Recording()
