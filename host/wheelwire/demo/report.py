"""The results of the demonstration."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Report:
    """The results of one run. Distances are the plant's, not those of the odometry."""

    distance_m: float
    position_error_m: float
    """Distance between the odometry and the true pose at standstill."""
    heading_error_rad: float
    frames_sent: int
    frames_received: int
    frames_lost: int
    crc_errors: int
    setpoints_expired: int
    """Setpoints that came too late: the wheels stopped meanwhile, for this computer was busy."""
    round_trip_p50_us: float
    round_trip_p99_us: float
    command_age_us: int
    """Age of the last setpoint when the drive was removed, on the device's clock."""
    drive_removed_after_deadline_us: int
    standstill_after_deadline_us: int
    stopping_distance_m: float
    """Distance between the removal of the drive and standstill."""
    picture: str | None
    """Path of the plot."""
    picture_error: str | None
    """Why there is no plot."""

    def rows(self) -> list[tuple[str, str]]:
        """Pairs of name and value, for a table."""
        return [
            ("distance driven", f"{self.distance_m:.3f} m"),
            (
                "final pose error (odometry against the plant)",
                f"{self.position_error_m * 1000:.1f} mm, "
                f"{abs(math.degrees(self.heading_error_rad)):.2f} deg",
            ),
            ("frames sent", str(self.frames_sent)),
            ("frames received", str(self.frames_received)),
            ("frames lost", str(self.frames_lost)),
            ("CRC errors", str(self.crc_errors)),
            (
                "round trip p50 / p99",
                f"{self.round_trip_p50_us / 1000:.2f} / {self.round_trip_p99_us / 1000:.2f} ms",
            ),
            ("stop: drive removed after the deadline", _ms(self.drive_removed_after_deadline_us)),
            ("stop: and after the last setpoint", _ms(self.command_age_us)),
            ("stop: standstill after the deadline", _ms(self.standstill_after_deadline_us)),
            ("stop: rolled out", f"{self.stopping_distance_m * 1000:.0f} mm"),
            ("picture", self.picture or f"none: {self.picture_error}"),
        ]


def _ms(microseconds: float) -> str:
    return f"{microseconds / 1000:.1f} ms"
