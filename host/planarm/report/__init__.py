"""Pictures and tables: plain values in, PNG files and terminal tables out. Knows no planner.

Importing this costs no matplotlib and no rich: each function imports what it draws with.
"""

from planarm.report.curves import draw_joint_angles, draw_step_rates, draw_tip_error
from planarm.report.tables import summary_table
from planarm.report.workspace import draw_workspace

__all__ = ["draw_joint_angles", "draw_step_rates", "draw_tip_error", "draw_workspace", "summary_table"]
