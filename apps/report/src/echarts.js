// The parts of ECharts that the figures use; what is not named here does not get into the page.
import {BarChart, CustomChart, LineChart, ScatterChart} from "echarts/charts";
import {GraphicComponent, GridComponent, LegendComponent, TooltipComponent} from "echarts/components";
import {init, setPlatformAPI, use} from "echarts/core";
import {CanvasRenderer, SVGRenderer} from "echarts/renderers";

use([BarChart, CustomChart, LineChart, ScatterChart, GraphicComponent, GridComponent, LegendComponent, TooltipComponent, CanvasRenderer, SVGRenderer]);

export {init, setPlatformAPI};
